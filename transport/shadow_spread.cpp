#include "transport/shadow_spread.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "core/check.h"
#include "core/moments.h"
#include "core/random.h"
#include "shading/fibre_angle.h"
#include "transport/path.h"

namespace weft::transport {

namespace {

// Where light that is seen entered, from below there to where it is seen.
struct Entry {
  double weight = 0;
  glm::dvec2 way_mm{0, 0};
};

double mean_of(const glm::vec3& rgb) { return static_cast<double>(rgb.x + rgb.y + rgb.z) / 3; }

// An eye ray, the scattering that it sees, and a path of at least one more.
Entry follow(const Scene& scene, std::span<const shading::FibreBcsdf> materials,
             const SpreadSettings& settings, core::Random& random) {
  const fabric::Tile& tile = scene.tile();
  const float x = random.uniform() * tile.size_mm.x;
  const float y = random.uniform() * tile.size_mm.y;
  const float cos_theta = std::sqrt(1 - random.uniform());
  const float sin_theta = std::sqrt(std::max(0.0f, 1 - cos_theta * cos_theta));
  const float phi = 2 * std::numbers::pi_v<float> * random.uniform();
  const glm::vec3 to_eye(sin_theta * std::cos(phi), sin_theta * std::sin(phi), cos_theta);
  const glm::vec3 above(x, y, tile.z_max_mm + 0.01f * (tile.z_max_mm - tile.z_min_mm));
  const std::optional<Hit> seen =
      scene.closest(above, -to_eye, std::numeric_limits<float>::infinity(), std::nullopt);
  if (!seen) {
    return {};
  }
  const fabric::Segment segment = tile.segment(seen->segment);
  const glm::mat3 frame = shading::fibre_frame(glm::normalize(segment.b_mm - segment.a_mm), to_eye);
  const shading::FibreBcsdf& bcsdf =
      materials[tile.strands[tile.segment_strand[seen->segment]].material];
  const float u_lobe = random.uniform();
  const float u_theta = random.uniform();
  const shading::BcsdfSample sample =
      bcsdf.sample(frame * to_eye, u_lobe, u_theta, random.uniform());
  if (!(sample.pdf > 0)) {
    return {};
  }
  Path path(scene, materials, seen->segment,
            glm::normalize(glm::transpose(frame) * sample.omega_i));
  while (path.advance()) {
    if (path.vertices() > settings.max_path_length || !path.scatter(random)) {
      return {};
    }
  }
  if (path.vertices() == 0 || !(path.direction().z > 0)) {
    return {};
  }
  const glm::dvec3 out(path.direction());
  const double rise_mm = static_cast<double>(tile.z_max_mm) - path.height_mm();
  return {std::min(kSpreadLargestWeight, mean_of(sample.weight * path.throughput())),
          path.travelled_mm() + glm::dvec2(out) * (std::max(0.0, rise_mm) / out.z)};
}

}  // namespace

SpreadSums spread_sums(const Scene& scene, std::span<const shading::FibreBcsdf> materials,
                       std::uint64_t first, std::uint64_t count, const SpreadSettings& settings,
                       const Checkpoint& checkpoint) {
  CHECK_EQ(materials.size(), scene.tile().material_names.size());
  CHECK(settings.bins > 0 && settings.bin_mm > 0);
  SpreadSums sums;
  sums.paths = count;
  sums.sum.assign(settings.bins + std::size_t{1}, 0);
  const auto add = [&](double distance_mm, double weight) {
    const double bin = std::min(distance_mm / settings.bin_mm, static_cast<double>(settings.bins));
    sums.sum[static_cast<std::size_t>(bin)] += core::to_fixed_point(weight);
  };
  for (std::uint64_t i = first; i < first + count; ++i) {
    core::Random random(settings.seed, 0, i);
    const Entry entry = follow(scene, materials, settings, random);
    if (entry.weight > 0) {
      add(std::fabs(entry.way_mm.x), entry.weight);
      add(std::fabs(entry.way_mm.y), entry.weight);
    }
    if ((i + 1) % kSpreadChunkPaths == 0) {
      pass(checkpoint);
    }
  }
  return sums;
}

}  // namespace weft::transport
