#include "fabric/fibres.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include <glm/geometric.hpp>

#include "core/random.h"
#include "fabric/hairs.h"
#include "fabric/normal_deviate.h"
#include "fabric/section_packing.h"

namespace weft::fabric {

namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;
// Purposes of random numbers, see core::derive_seed.
constexpr std::uint32_t kPhasePurpose = 0x67656f01;
constexpr std::uint32_t kFibrePurpose = 0x67656f02;
constexpr std::uint32_t kLoopPurpose = 0x67656f03;
constexpr int kMaxDraws = 1000;
// Places tried for a loop so that it bulges out of the yarn and not into another ply.
constexpr int kLoopDraws = 8;

// A loop replaces r_max over one migration turn of its fibre.
struct Loop {
  std::int64_t turn = 0;
  double reach = 0;  // R at the apex, in units of the ply's radius
};

struct Fibre {
  double radius = 0;  // R_i
  double angle = 0;   // theta_i
  double offset = 0;  // where its nodes lie, a share of a segment
  std::optional<Loop> loop;
};

struct PlyPlace {
  double radial_mm = 0;
  double tangential_mm = 0;
};

// Zhao et al. 2016: a point of the unit disc, accepted with probability p(R).
double draw_radius(const v1::Migration& migration, core::Random& random) {
  const double power = migration.density_power();
  const double core = migration.core();
  const double most = std::max(1 - core, core);
  for (int draw = 0; draw < kMaxDraws; ++draw) {
    const double radius = std::sqrt(random.uniform_double());
    const double falloff = (std::numbers::e - std::exp(radius)) / (std::numbers::e - 1);
    const double density = (1 - 2 * core) * std::pow(falloff, power) + core;
    if (random.uniform_double() * most <= density) {
      return radius;
    }
  }
  return 0;  // a density that is zero nearly everywhere lies on the axis
}

class FibreLayer {
 public:
  FibreLayer(const FibreJob& job, Tile& tile)
      : job_(job), tile_(tile), turns_(whole_turns(job.yarn, job.path.length_mm())) {
    const PlySection& section = job.model.section;
    const double radius = job.model.yarn_radius_mm;
    core::Random random(core::derive_seed(job.seed, kPhasePurpose), job.thread);
    phase_ = random.uniform_double() * kTwoPi;
    distance_mm_ = section.distance * radius;
    radial_mm_ = std::max(0.0, section.radial * radius - job.model.fibre_radius_mm);
    tangential_mm_ = std::max(0.0, section.tangential * radius - job.model.fibre_radius_mm);
  }

  void lay() {
    std::vector<Fibre> fibres = draw_fibres();
    draw_loops(fibres);
    for (std::size_t f = 0; f < fibres.size(); ++f) {
      append(fibres[f], static_cast<std::uint32_t>(f / job_.model.fibres_per_ply));
    }
  }

 private:
  [[nodiscard]] std::vector<Fibre> draw_fibres() const {
    std::vector<Fibre> fibres;
    const std::uint64_t seed = core::derive_seed(job_.seed, kFibrePurpose);
    const std::uint32_t count = job_.model.plies * job_.model.fibres_per_ply;
    for (std::uint32_t f = 0; f < count; ++f) {
      core::Random random(seed, job_.thread, f);
      Fibre fibre;
      fibre.radius = draw_radius(job_.yarn.migration(), random);
      fibre.angle = random.uniform_double() * kTwoPi;
      fibre.offset = random.uniform_double();
      fibres.push_back(fibre);
    }
    for (std::uint32_t ply = 0; ply < job_.model.plies; ++ply) {
      spread({fibres.data() + std::size_t{ply} * job_.model.fibres_per_ply,
              job_.model.fibres_per_ply});
    }
    return fibres;
  }

  // Moves the fibres of one ply apart in its section. The phase of a fibre's migration is its
  // angle, so that neighbours stay neighbours all along the ply.
  void spread(std::span<Fibre> fibres) const {
    const glm::dvec2 half{radial_mm_, tangential_mm_};
    if (!(half.x > 0) || !(half.y > 0)) {
      return;
    }
    std::vector<glm::dvec2> points;
    for (const Fibre& fibre : fibres) {
      points.push_back(half * glm::dvec2(std::cos(fibre.angle), std::sin(fibre.angle)) *
                       fibre.radius);
    }
    spread_in_ellipse(points, half, 2 * job_.model.fibre_radius_mm);
    for (std::size_t f = 0; f < fibres.size(); ++f) {
      const glm::dvec2 at = points[f] / half;
      fibres[f].radius = glm::length(at);
      fibres[f].angle = std::atan2(at.y, at.x);
    }
  }

  // A fibre with a loop migrates even when the others do not.
  [[nodiscard]] std::int64_t migration_turns(const Fibre& fibre) const {
    return fibre.loop ? std::max<std::int64_t>(1, turns_.migration) : turns_.migration;
  }

  void draw_loops(std::vector<Fibre>& fibres) const {
    const v1::Loops& loops = job_.yarn.loops();
    core::Random random(core::derive_seed(job_.seed, kLoopPurpose), job_.thread);
    const double expected = loops.per_mm() * job_.path.length_mm() * job_.model.share;
    const auto count = static_cast<std::uint32_t>(std::min(
        std::floor(expected + random.uniform_double()), static_cast<double>(fibres.size())));
    const double ply_radius_mm = std::sqrt(radial_mm_ * tangential_mm_);
    for (std::uint32_t k = 0; k < count && ply_radius_mm > 0; ++k) {
      Fibre* fibre = nullptr;
      for (int draw = 0; draw < kLoopDraws && fibre == nullptr; ++draw) {
        Fibre& candidate = fibres[random.below(static_cast<std::uint32_t>(fibres.size()))];
        if (!candidate.loop) {
          candidate.loop = Loop{};
          fibre = &candidate;
        }
      }
      if (fibre == nullptr) {
        continue;
      }
      const double bulge =
          std::max(0.0, draw_normal(random, loops.reach_mm(), loops.reach_sd_mm()));
      fibre->loop->reach = 1 + bulge / ply_radius_mm;
      const auto turns = static_cast<std::uint32_t>(migration_turns(*fibre));
      for (int draw = 0; draw < kLoopDraws; ++draw) {
        fibre->loop->turn = random.below(turns);
        if (std::cos(fibre_angle(*fibre, apex(*fibre))) > 0) {
          break;
        }
      }
    }
  }

  // Where along the period the loop reaches farthest.
  [[nodiscard]] double apex(const Fibre& fibre) const {
    const auto turns = static_cast<double>(migration_turns(fibre));
    return (static_cast<double>(fibre.loop->turn) + 1 - fibre.angle / kTwoPi) / turns;
  }

  // The fibre's angle in its ply, from the direction away from the yarn's axis.
  [[nodiscard]] double fibre_angle(const Fibre& fibre, double share) const {
    return fibre.angle - kTwoPi * static_cast<double>(turns_.fibre) * share;
  }

  // R(theta) in units of the ply's radius, at a share of the period in [0, 1).
  [[nodiscard]] double migrated_radius(const Fibre& fibre, double share) const {
    const v1::Migration& migration = job_.yarn.migration();
    const auto turns = static_cast<double>(migration_turns(fibre));
    const double phase = fibre.angle / kTwoPi + turns * share;
    const double cosine = std::cos(kTwoPi * phase);
    double r_max = fibre.radius * migration.r_max();
    const double r_min = fibre.radius * migration.r_min();
    if (fibre.loop) {
      // The loop's turn runs from minimum to minimum, half a turn either side of its apex.
      const auto turn = static_cast<std::int64_t>(std::floor(phase - 0.5));
      const std::int64_t wrapped =
          ((turn % migration_turns(fibre)) + migration_turns(fibre)) % migration_turns(fibre);
      if (wrapped == fibre.loop->turn) {
        r_max = fibre.loop->reach;
      }
    }
    return 0.5 * (r_max + r_min + (r_max - r_min) * cosine);
  }

  [[nodiscard]] glm::dvec3 place(const Fibre& fibre, std::uint32_t ply, double share) const {
    const double along = share - std::floor(share);
    const double radius = migrated_radius(fibre, along);
    const double angle = fibre_angle(fibre, along);
    const double radial = distance_mm_ + radial_mm_ * radius * std::cos(angle);
    const double tangential = tangential_mm_ * radius * std::sin(angle);
    const double ply_angle = phase_ + kTwoPi * (static_cast<double>(ply) / job_.model.plies -
                                                static_cast<double>(turns_.ply) * along);
    const double cosine = std::cos(ply_angle);
    const double sine = std::sin(ply_angle);
    return job_.path.at(share).place_mm(
        {radial * cosine - tangential * sine, radial * sine + tangential * cosine});
  }

  void append(const Fibre& fibre, std::uint32_t ply) {
    const double segment_length = job_.segment_length_radii * job_.model.fibre_radius_mm;
    const std::uint32_t segments = segments_per_strand(job_.path.length_mm(), segment_length);
    tile_.strands.push_back({static_cast<std::uint32_t>(tile_.points_mm.size()), segments + 1,
                             job_.material, job_.thread,
                             static_cast<float>(job_.model.fibre_radius_mm), job_.period.x,
                             job_.period.y});
    for (std::uint32_t k = 0; k < segments; ++k) {
      tile_.points_mm.emplace_back(place(fibre, ply, (k + fibre.offset) / segments));
    }
    const glm::vec3 first = tile_.points_mm[tile_.strands.back().first_point];
    tile_.points_mm.push_back(period_end(first, job_.period, tile_.size_mm));
  }

  const FibreJob& job_;
  Tile& tile_;
  Turns turns_;
  double phase_ = 0;
  double distance_mm_ = 0;
  double radial_mm_ = 0;
  double tangential_mm_ = 0;
};

}  // namespace

Turns whole_turns(const v1::Yarn& yarn, double length_mm) {
  const auto whole = [](double turns) { return static_cast<std::int64_t>(std::nearbyint(turns)); };
  Turns turns;
  turns.ply = whole(yarn.ply_twist_per_cm() * length_mm / 10);
  turns.fibre = whole(yarn.fibre_twist_per_cm() * length_mm / 10);
  turns.migration = std::abs(whole(yarn.migration().rate() * static_cast<double>(turns.fibre)));
  return turns;
}

std::uint32_t segments_per_strand(double length_mm, double segment_length_mm) {
  return static_cast<std::uint32_t>(std::max(2.0, std::nearbyint(length_mm / segment_length_mm)));
}

void lay_fibres(const FibreJob& job, Tile& tile) {
  FibreLayer(job, tile).lay();
  lay_hairs(job, tile);
}

}  // namespace weft::fabric
