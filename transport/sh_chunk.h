#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace weft::transport {

// Sums of products of spherical harmonics over a few hundred paths, in float, and their transfer to
// fixed point. Order matters within a chunk and nowhere else.
class ShChunk {
 public:
  // Sums of a chunk saturate here: below 2^25, so that 64 chunks of a shard stay within 2^63.
  static constexpr double kLargestSum = 0x1p25 - 1;

  // REQUIRES: order <= 5.
  explicit ShChunk(std::uint32_t order);

  // Entries of a matrix: 3 colours, (order+1)^2 rows, (order+1)^2 columns.
  [[nodiscard]] std::size_t size() const { return 3 * coefficients_ * coefficients_; }

  // Adds weight[c] Y_row(row_direction) Y_column(column_direction) and its square to every entry.
  // A weight of zero costs nothing.
  void add(glm::vec3 weight, glm::vec3 row_direction, glm::vec3 column_direction);

  // Adds the sums to fixed-point ones of size() entries, [3, rows, columns], and starts anew.
  void flush(std::span<std::int64_t> sum, std::span<std::int64_t> sum_of_squares);

 private:
  std::size_t coefficients_;
  std::size_t stride_;  // coefficients_ rounded up to whole vector registers
  bool empty_ = true;
  std::vector<float> sum_;  // [3, coefficients_, stride_]
  std::vector<float> sum_of_squares_;
};

}  // namespace weft::transport
