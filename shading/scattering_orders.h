#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

// How the light of a cell is sorted by how often it was scattered, so that its transfer can be had
// in other colours (docs/decisions/colourways-by-orders.md). Baker, commit and reader share this.

namespace weft::shading {

// Bin b holds light that was scattered kFirstOrder[b] times or more, but less than
// kFirstOrder[b + 1] times; the last one has no end.
inline constexpr std::size_t kOrderBins = 11;
inline constexpr std::array<std::uint32_t, kOrderBins> kFirstOrder{1,  2,  3,  4,  5, 7,
                                                                   10, 15, 23, 35, 55};

[[nodiscard]] constexpr std::size_t order_bin(std::uint32_t scatterings) {
  std::size_t bin = 0;
  while (bin + 1 < kOrderBins && scatterings >= kFirstOrder[bin + 1]) {
    ++bin;
  }
  return bin;
}

// Matrices of low harmonic order are kept for these bins together: {2}, {3, 4}, {5 to 9} and
// {10 ...} scatterings. What is scattered once is the rest.
inline constexpr std::size_t kOrderShapes = 4;
[[nodiscard]] constexpr std::size_t shape_of_bin(std::size_t bin) {
  return bin <= 1 ? 0 : bin <= 3 ? 1 : bin <= 5 ? 2 : 3;
}
inline constexpr std::uint32_t kShapeOrder = 3;
[[nodiscard]] constexpr std::size_t shape_coefficients(std::uint32_t sh_order) {
  const std::size_t bands = std::size_t{std::min(sh_order, kShapeOrder)} + 1;
  return bands * bands;
}

// Of cloth of more materials nothing is kept.
inline constexpr std::size_t kMostCountedMaterials = 4;

// Light that met one material only, and light that met several, most often this one: for each
// material a group of the first and of the second kind.
[[nodiscard]] constexpr std::size_t order_groups(std::size_t materials) {
  return materials == 1 ? 1 : 2 * materials;
}
// What is counted of the light of a bin: scatterings, and for each material those by C_R and those
// by (1 - C_R) C_TT. The rest is Schlick's grazing reflection, which has no colour.
[[nodiscard]] constexpr std::size_t order_counts(std::size_t materials) {
  return 1 + 2 * materials;
}

}  // namespace weft::shading
