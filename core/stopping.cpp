#include "core/stopping.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/check.h"
#include "core/moments.h"

namespace weft::core {

namespace {

bool passes_half_range(std::int64_t sum) {
  constexpr std::int64_t kHalfRange = std::int64_t{1} << 62;
  return sum >= kHalfRange || sum <= -kHalfRange;
}

bool fills_range(const PathSums& sums) {
  return std::any_of(sums.sum.begin(), sums.sum.end(), passes_half_range) ||
         std::any_of(sums.sum_of_squares.begin(), sums.sum_of_squares.end(), passes_half_range);
}

}  // namespace

double root_mean_square_error(const PathSums& sums) {
  CHECK_EQ(sums.sum.size(), sums.sum_of_squares.size());
  if (sums.sum.empty()) {
    return 0;
  }
  double squares = 0;
  for (std::size_t i = 0; i < sums.sum.size(); ++i) {
    const MeanAndError moments =
        mean_and_error(from_fixed_point(sums.sum[i]), from_fixed_point(sums.sum_of_squares[i]),
                       static_cast<double>(sums.paths));
    squares += moments.standard_error * moments.standard_error;
  }
  return std::sqrt(squares / static_cast<double>(sums.sum.size()));
}

bool ends_at(const StoppingRule& rule, const PathSums& sums) {
  if (sums.paths >= rule.most_paths) {
    return sums.paths == rule.most_paths;
  }
  if (sums.paths % kStoppingBlockPaths != 0 ||
      sums.paths < kFewestStoppingBlocks * kStoppingBlockPaths) {
    return false;
  }
  return root_mean_square_error(sums) <= rule.target_standard_error || fills_range(sums);
}

}  // namespace weft::core
