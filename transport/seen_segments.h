#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/random.h"
#include "transport/checkpoint.h"
#include "transport/scene.h"

namespace weft::transport {

// How often each segment is the first that an eye sees: `rays_per_segment` times as many rays as
// there are segments come down on the cloth, evenly spread over it and over the directions that a
// level plane sees (density cos / pi). The average of transfer over a cell counts its segments by
// this: what the eye meets lies near the top of its cell, and a plain average, as in Khungurn et
// al. 2017, section 4.2, is darker by 10 to 37 % where cells span 2.5 mean free paths.
// Returns [segments]. REQUIRES: rays_per_segment > 0.
[[nodiscard]] std::vector<std::uint32_t> seen_segments(const Scene& scene,
                                                       std::uint32_t rays_per_segment,
                                                       std::uint64_t seed,
                                                       const Checkpoint& checkpoint = {});

// The segments of one cell, to be drawn in proportion to their weights.
struct CellSegments {
  std::vector<std::uint32_t> segments;
  // Sums of the weights up to and with each segment; empty where no eye sees into the cell: all its
  // segments count alike.
  std::vector<std::uint32_t> weight_sums;

  // REQUIRES: `segments` is not empty.
  [[nodiscard]] std::uint32_t draw(core::Random& random) const { return at(random.bits()); }
  // The one at `share` in units of 2^-32 of the sum of the weights. REQUIRES: as draw().
  [[nodiscard]] std::uint32_t at(std::uint32_t share) const;
};

// The segments of each cell, in order, weighted by `seen`. Throws core::Error(kDataLoss) when the
// arrays contradict one another or a cell is empty.
[[nodiscard]] std::vector<CellSegments> segments_by_cell(
    std::span<const std::uint32_t> cell_of_segment, std::size_t cells,
    std::span<const std::uint32_t> seen);

}  // namespace weft::transport
