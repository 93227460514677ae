#pragma once

#include <cstdint>
#include <span>

namespace weft::core {

// When a cell has enough paths. The baker that stops and the commit that checks where it stopped
// share this rule. It looks at whole blocks of paths only, in order, so that where a cell stops
// depends on its paths and on nothing else.
inline constexpr std::uint64_t kStoppingBlockPaths = 256;
// Fewer say too little about their own error. Measured over seeds, four know it to 1.5 % (standard
// deviation) with exit sampling, and to 10 % (wide lobes) to 30 % (lobes of 0.6 degrees) with
// lights.
inline constexpr std::uint64_t kFewestStoppingBlocks = 4;
// The most paths of a cell that may stop early: the sums of all are one shard's (core/moments.h).
inline constexpr std::uint64_t kMostStoppingPaths = 1U << 20;

struct StoppingRule {
  double target_standard_error = 0;  // above 0
  std::uint64_t most_paths = 0;      // at most kMostStoppingPaths
};

// Sums over `paths` paths of estimates of several numbers and of their squares, in fixed point
// (core/moments.h); the spans are equally long.
struct PathSums {
  std::span<const std::int64_t> sum;
  std::span<const std::int64_t> sum_of_squares;
  std::uint64_t paths = 0;
};

// Root of the mean, over the numbers, of their squared standard errors. 0 when there are none.
[[nodiscard]] double root_mean_square_error(const PathSums& sums);

// True when these are sums after which a cell may end: those of most_paths; or those of
// kFewestStoppingBlocks or more whole blocks whose root_mean_square_error is at or below the
// target, or one of whose sums has passed half the range of fixed point, so that more might not
// fit. A block adds less than an eighth of the range to any sum, so sums fit wherever the first
// such end is.
[[nodiscard]] bool ends_at(const StoppingRule& rule, const PathSums& sums);

}  // namespace weft::core
