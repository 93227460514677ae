#include "transport/seen_segments.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>

#include "core/check.h"
#include "core/error.h"
#include "core/random.h"

namespace weft::transport {
namespace {

constexpr std::uint64_t kPurpose = 0x7365656e;  // "seen"
constexpr std::uint64_t kCheckpointRays = 8192;

}  // namespace

std::vector<std::uint32_t> seen_segments(const Scene& scene, std::uint32_t rays_per_segment,
                                         std::uint64_t seed, const Checkpoint& checkpoint) {
  CHECK_GT(rays_per_segment, 0U);
  const fabric::Tile& tile = scene.tile();
  const std::uint64_t own_seed = core::derive_seed(seed, kPurpose);
  const std::uint64_t rays = std::uint64_t{rays_per_segment} * tile.segment_count();
  std::vector<std::uint32_t> seen(tile.segment_count(), 0);
  for (std::uint64_t i = 0; i < rays; ++i) {
    if (i % kCheckpointRays == 0) {
      pass(checkpoint);
    }
    core::Random random(own_seed, 0, i);
    const float u_sine = random.uniform();
    const float phi = 2 * std::numbers::pi_v<float> * random.uniform();
    const float x = random.uniform() * tile.size_mm.x;
    const float y = random.uniform() * tile.size_mm.y;
    const float sine = std::sqrt(u_sine);
    const auto hit = scene.closest(
        {x, y, tile.z_max_mm}, {sine * std::cos(phi), sine * std::sin(phi), -std::sqrt(1 - u_sine)},
        std::numeric_limits<float>::infinity(), std::nullopt);
    if (hit) {
      ++seen[hit->segment];
    }
  }
  return seen;
}

std::uint32_t CellSegments::at(std::uint32_t share) const {
  if (weight_sums.empty()) {
    return segments[(std::uint64_t{share} * segments.size()) >> 32];
  }
  const std::uint64_t drawn = (std::uint64_t{share} * weight_sums.back()) >> 32;
  const auto found = std::upper_bound(weight_sums.begin(), weight_sums.end(), drawn);
  return segments[static_cast<std::size_t>(found - weight_sums.begin())];
}

std::vector<CellSegments> segments_by_cell(std::span<const std::uint32_t> cell_of_segment,
                                           std::size_t cells, std::span<const std::uint32_t> seen) {
  const auto require = [](bool holds, const char* what) {
    if (!holds) {
      throw core::Error(core::Code::kDataLoss, std::string("the grid is damaged: ") + what);
    }
  };
  require(seen.size() == cell_of_segment.size(), "it has not one seen count for each segment");
  std::vector<CellSegments> by_cell(cells);
  for (std::uint32_t k = 0; k < cell_of_segment.size(); ++k) {
    require(cell_of_segment[k] < cells, "it names a cell that it does not have");
    CellSegments& cell = by_cell[cell_of_segment[k]];
    const std::uint64_t sum =
        std::uint64_t{cell.weight_sums.empty() ? 0 : cell.weight_sums.back()} + seen[k];
    require(sum <= std::numeric_limits<std::uint32_t>::max(), "its seen counts are too large");
    cell.segments.push_back(k);
    cell.weight_sums.push_back(static_cast<std::uint32_t>(sum));
  }
  for (CellSegments& cell : by_cell) {
    require(!cell.segments.empty(), "a cell is without segments");
    if (cell.weight_sums.back() == 0) {
      cell.weight_sums.clear();
    }
  }
  return by_cell;
}

}  // namespace weft::transport
