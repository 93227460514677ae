#include "fabric/hairs.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/random.h"
#include "fabric/normal_deviate.h"

namespace weft::fabric {

namespace {

constexpr std::uint32_t kHairPurpose = 0x67656f04;
// Roots lie in the outer part of the yarn, from this share of its radius on.
constexpr double kInnermostRoot = 0.6;
constexpr double kDegree = std::numbers::pi / 180;

struct Hair {
  double root_mm = 0;  // along the yarn
  double run_mm = 0;   // along the yarn from root to tip; negative runs back
  double root_distance_mm = 0;
  double tip_distance_mm = 0;
  double root_angle = 0;
  double sweep = 0;
};

Hair draw_hair(const v1::Yarn& yarn, const YarnModel& model, double length_mm,
               core::Random& random) {
  const v1::Hairs& hairs = yarn.hairs();
  const double inner = std::max(0.0, model.yarn_radius_mm - model.fibre_radius_mm);
  Hair hair;
  hair.root_mm = random.uniform_double() * length_mm;
  hair.root_distance_mm = inner * (kInnermostRoot + (1 - kInnermostRoot) * random.uniform_double());
  hair.root_angle = random.uniform_double() * 2 * std::numbers::pi;
  const double run_sign = random.uniform_double() < 0.5 ? -1 : 1;
  const double sweep_sign = random.uniform_double() < 0.5 ? -1 : 1;
  hair.run_mm = run_sign * draw_normal(random, hairs.length_mm(), hairs.length_sd_mm());
  hair.tip_distance_mm =
      model.yarn_radius_mm +
      std::max(model.fibre_radius_mm, draw_normal(random, hairs.reach_mm(), hairs.reach_sd_mm()));
  hair.sweep = sweep_sign * kDegree * draw_normal(random, hairs.sweep_deg(), hairs.sweep_sd_deg());
  return hair;
}

double length_of(double run_mm, double rise_mm, double arc_mm) {
  return std::sqrt(run_mm * run_mm + rise_mm * rise_mm + arc_mm * arc_mm);
}

glm::dvec3 place(const Hair& hair, const FibreJob& job, double f) {
  const double distance =
      hair.root_distance_mm + (hair.tip_distance_mm - hair.root_distance_mm) * f;
  const double angle = hair.root_angle + hair.sweep * f;
  const YarnFrame frame = job.path.at((hair.root_mm + hair.run_mm * f) / job.path.length_mm());
  const glm::dvec2 direction{std::cos(angle), std::sin(angle)};
  // The pressed section scales what lies inside it; beyond it distances are as they are.
  const double inside = std::min(distance, job.model.yarn_radius_mm);
  return frame.place_mm(direction * inside) +
         (frame.normal * direction.x + frame.lateral * direction.y) * (distance - inside);
}

}  // namespace

double expected_hairs(const v1::Yarn& yarn, const YarnModel& model, double length_mm) {
  return yarn.hairs().per_mm() * length_mm * model.share;
}

double mean_hair_length_mm(const v1::Yarn& yarn, const YarnModel& model) {
  const v1::Hairs& hairs = yarn.hairs();
  const double rise = hairs.reach_mm() + 0.5 * (1 - kInnermostRoot) * model.yarn_radius_mm;
  const double arc = kDegree * hairs.sweep_deg() * (model.yarn_radius_mm + 0.5 * hairs.reach_mm());
  return length_of(hairs.length_mm(), rise, arc);
}

void lay_hairs(const FibreJob& job, Tile& tile) {
  const double length_mm = job.path.length_mm();
  const std::uint64_t seed = core::derive_seed(job.seed, kHairPurpose);
  core::Random count_random(seed, job.thread);
  const auto count = static_cast<std::uint32_t>(
      std::floor(expected_hairs(job.yarn, job.model, length_mm) + count_random.uniform_double()));
  const double segment_length = job.segment_length_radii * job.model.fibre_radius_mm;
  for (std::uint32_t h = 0; h < count; ++h) {
    core::Random random(seed, job.thread, std::uint64_t{h} + 1);
    const Hair hair = draw_hair(job.yarn, job.model, length_mm, random);
    const double arc = hair.sweep * 0.5 * (hair.root_distance_mm + hair.tip_distance_mm);
    const double length = length_of(hair.run_mm, hair.tip_distance_mm - hair.root_distance_mm, arc);
    const std::uint32_t segments = segments_per_strand(length, segment_length);
    tile.strands.push_back({static_cast<std::uint32_t>(tile.points_mm.size()), segments + 1,
                            job.material, job.thread, static_cast<float>(job.model.fibre_radius_mm),
                            0, 0});
    for (std::uint32_t k = 0; k <= segments; ++k) {
      tile.points_mm.emplace_back(place(hair, job, static_cast<double>(k) / segments));
    }
  }
}

}  // namespace weft::fabric
