#pragma once

#include <cstdint>

#include <glm/vec2.hpp>

#include "fabric/ply.h"
#include "fabric/thread_path.h"
#include "fabric/tile.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// One thread whose fibres are to be laid.
struct FibreJob {
  const v1::Yarn& yarn;
  const YarnModel& model;
  const ThreadPath& path;
  double segment_length_radii = 8;
  glm::ivec2 period{0, 0};
  std::uint32_t thread = 0;    // index into Tile::threads; also the random stream
  std::uint32_t material = 0;  // index into Tile::material_names
  std::uint64_t seed = 0;      // the description's
};

// Turns of a thread over one period: the description's turns per centimetre times the length,
// rounded to whole turns, so that the thread meets itself where the tile repeats.
struct Turns {
  std::int64_t ply = 0;
  std::int64_t fibre = 0;      // relative to the ply's own frame, which turns with the ply
  std::int64_t migration = 0;  // rate times the fibre turns, rounded
};
[[nodiscard]] Turns whole_turns(const v1::Yarn& yarn, double length_mm);

// Straight segments of a strand of this length; at least 2.
[[nodiscard]] std::uint32_t segments_per_strand(double length_mm, double segment_length_mm);

// Where a periodic strand that starts at `first` ends: exact in single precision.
[[nodiscard]] inline glm::vec3 period_end(glm::vec3 first, glm::ivec2 period, glm::vec2 size_mm) {
  return first + glm::vec3(static_cast<float>(period.x) * size_mm.x,
                           static_cast<float>(period.y) * size_mm.y, 0);
}

// Appends the thread's strands to the tile: ply by ply the regular fibres, with the period of the
// thread, then the hairs, with open ends. The model is that of Zhao, Luan, Bala 2016 as restated by
// Wu and Yuksel 2017 (equations 1 and 2, section 3.1): a fibre lies in its ply at
//   R(theta) = R_i/2 (r_max + r_min + (r_max - r_min) cos(theta_i + s theta))
// with R_i drawn from the density (1 - 2 core) ((e - e^R)/(e - 1))^density_power + core over the
// unit disc. Positive twist is S: looking along the yarn, the turn is counter to a right-hand
// screw.
void lay_fibres(const FibreJob& job, Tile& tile);

}  // namespace weft::fabric
