#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace weft::transport {

// Light that a path has found: from where, and how much of it arrives, by channel.
struct LightSample {
  glm::vec3 weight{0, 0, 0};
  glm::vec3 direction{0, 0, 1};
};

// Sums over a few hundred paths of products of spherical harmonics and of their squares, in float,
// and their transfer to fixed point. Order matters within a chunk and nowhere else: blocks of
// kBlockPaths paths that found light are matrix products of one shape, added in order.
class ShChunk {
 public:
  // Sums of a chunk saturate here: below 2^25, so that 64 chunks of a shard stay within 2^63.
  static constexpr double kLargestSum = 0x1p25 - 1;
  static constexpr std::size_t kBlockPaths = 64;

  // REQUIRES: order <= 5.
  explicit ShChunk(std::uint32_t order);

  // Entries of a matrix: 3 colours, (order+1)^2 rows, (order+1)^2 columns.
  [[nodiscard]] std::size_t size() const { return 3 * coefficients_ * coefficients_; }

  // Adds what one path estimates, Y_row(arrival) times the sum over `lights` of
  // weight[c] Y_column(direction), and its square to every entry. No light costs nothing.
  void add(glm::vec3 arrival, std::span<const LightSample> lights);

  // Adds the sums to fixed-point ones of size() entries, [3, rows, columns], and starts anew.
  void flush(std::span<std::int64_t> sum, std::span<std::int64_t> sum_of_squares);

 private:
  void project_block();

  std::size_t coefficients_;
  std::size_t rows_;     // coefficients_, rounded up to whole tiles of the product
  std::size_t columns_;  // 3 coefficients_, the same
  bool empty_ = true;
  std::size_t paths_ = 0;        // in the block
  std::vector<float> arrivals_;  // [kBlockPaths, rows_]
  std::vector<float> lights_;    // [kBlockPaths, columns_], columns by colour and coefficient
  std::vector<float> sum_;       // [rows_, columns_]
  std::vector<float> sum_of_squares_;
};

}  // namespace weft::transport
