#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// One repeat of a weave: which thread is on top at every crossing, and which yarn every thread is.
// Ends (warp threads) are numbered from 0 across, along x; picks (weft threads) from 0 along y.
struct Draft {
  std::uint32_t ends = 0;
  std::uint32_t picks = 0;
  std::vector<std::uint8_t> up;         // [picks, ends]: 1 where the warp is on top
  std::vector<std::string> end_yarns;   // [ends] names of the description's yarns
  std::vector<std::string> pick_yarns;  // [picks]

  // REQUIRES: pick < picks, end < ends.
  [[nodiscard]] bool warp_up(std::uint32_t pick, std::uint32_t end) const {
    return up[static_cast<std::size_t>(pick) * ends + end] != 0;
  }
  bool operator==(const Draft&) const = default;
};

// Most threads in either direction, and most crossings, that a draft may have.
inline constexpr std::uint32_t kMaxThreads = 1U << 15;
inline constexpr std::uint64_t kMaxCrossings = std::uint64_t{1} << 26;

// The draft of a weave, from its matrix or from the text of its WIF file: cropped as the weave says
// and reduced to its minimal repeat. The yarns are part of the repeat; colours only as far as they
// choose a yarn. Throws core::Error(kInvalidArgument) when there is no draft, the matrix or the WIF
// text is broken, the crop lies outside, a thread has no yarn or a limit is exceeded. Reads no
// file.
[[nodiscard]] Draft draft_of(const v1::Weave& weave);

// The smallest draft that, repeated in both directions, gives this one again.
[[nodiscard]] Draft minimal_repeat(const Draft& draft);

}  // namespace weft::fabric
