#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fabric/wif.h"

namespace weft::fabric {

// For every thread or treadle the numbers of what it is on or moves, from 1, ascending.
using NumberLists = std::vector<std::vector<std::uint32_t>>;

// How a loom makes the sheds of a draft.
struct Shed {
  NumberLists threading;  // [ends] shafts that hold the end; none: it stays down
  NumberLists moved;      // [picks] shafts that move at the pick
  bool rising = true;     // false: shafts that move sink, and all others are up
};

// Draws the draft down: fills draft.up from the shed. REQUIRES: draft.warp.count ends and
// draft.weft.count picks in the shed.
void draw_down(const Shed& shed, WifDraft& draft);

// The shafts that every pick moves: the union of what its treadles are tied to. REQUIRES: treadles
// pressed are at most tied.size().
[[nodiscard]] NumberLists moved_by_treadles(const NumberLists& pressed, const NumberLists& tied);

// What to say about threads that never change sides; nothing when there are none.
[[nodiscard]] std::optional<std::string> note_on_unbound(const WifDraft& draft);

// The most shafts that one end may be on.
inline constexpr std::uint32_t kMaxShaftsPerEnd = 64;

}  // namespace weft::fabric
