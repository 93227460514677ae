#pragma once

#include <span>
#include <vector>

namespace weft::render {

// The x >= 0 that minimises |A x - b|, given by its normal equations: `gram` is A^T A, [n, n], and
// `projected` is A^T b, [n] (Lawson and Hanson 1974, chapter 23). Columns of A that others explain
// as well get 0. REQUIRES: gram is symmetric with a positive diagonal.
[[nodiscard]] std::vector<double> nonnegative_least_squares(std::span<const double> gram,
                                                            std::span<const double> projected);

}  // namespace weft::render
