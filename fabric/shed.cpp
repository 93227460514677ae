#include "fabric/shed.h"

#include <algorithm>

#include "fabric/draft_text.h"

namespace weft::fabric {

void draw_down(const Shed& shed, WifDraft& draft) {
  std::uint32_t shafts = 0;
  for (const NumberLists* lists : {&shed.threading, &shed.moved}) {
    for (const std::vector<std::uint32_t>& list : *lists) {
      shafts = std::max(shafts, list.empty() ? 0 : list.back());
    }
  }
  draft.up.assign(static_cast<std::size_t>(draft.warp.count) * draft.weft.count, 0);
  std::vector<std::uint8_t> is_moved(std::size_t{shafts} + 1, 0);
  for (std::uint32_t pick = 0; pick < draft.weft.count; ++pick) {
    std::fill(is_moved.begin(), is_moved.end(), std::uint8_t{0});
    for (const std::uint32_t shaft : shed.moved[pick]) {
      is_moved[shaft] = 1;
    }
    for (std::uint32_t end = 0; end < draft.warp.count; ++end) {
      const std::vector<std::uint32_t>& held = shed.threading[end];
      const bool any = std::any_of(held.begin(), held.end(),
                                   [&](std::uint32_t shaft) { return is_moved[shaft] != 0; });
      draft.up[static_cast<std::size_t>(pick) * draft.warp.count + end] =
          any == shed.rising ? 1 : 0;
    }
  }
}

NumberLists moved_by_treadles(const NumberLists& pressed, const NumberLists& tied) {
  std::uint32_t shafts = 0;
  for (const std::vector<std::uint32_t>& list : tied) {
    shafts = std::max(shafts, list.empty() ? 0 : list.back());
  }
  NumberLists moved(pressed.size());
  std::vector<std::uint8_t> is_moved(std::size_t{shafts} + 1);
  for (std::size_t pick = 0; pick < pressed.size(); ++pick) {
    std::fill(is_moved.begin(), is_moved.end(), std::uint8_t{0});
    for (const std::uint32_t treadle : pressed[pick]) {
      for (const std::uint32_t shaft : tied[treadle - 1]) {
        is_moved[shaft] = 1;
      }
    }
    for (std::uint32_t shaft = 1; shaft <= shafts; ++shaft) {
      if (is_moved[shaft] != 0) {
        moved[pick].push_back(shaft);
      }
    }
  }
  return moved;
}

std::optional<std::string> note_on_unbound(const WifDraft& draft) {
  std::vector<std::uint32_t> over_end(draft.warp.count, 0);
  std::uint32_t loose_picks = 0;
  for (std::uint32_t pick = 0; pick < draft.weft.count; ++pick) {
    std::uint32_t over_pick = 0;
    for (std::uint32_t end = 0; end < draft.warp.count; ++end) {
      const std::uint8_t up = draft.up[static_cast<std::size_t>(pick) * draft.warp.count + end];
      over_end[end] += up;
      over_pick += up;
    }
    loose_picks += over_pick == 0 || over_pick == draft.warp.count ? 1U : 0U;
  }
  const auto loose_ends = std::count_if(over_end.begin(), over_end.end(), [&](std::uint32_t n) {
    return n == 0 || n == draft.weft.count;
  });
  if (loose_ends == 0 && loose_picks == 0) {
    return std::nullopt;
  }
  return number_of(static_cast<std::size_t>(loose_ends), "end") + " and " +
         number_of(loose_picks, "pick") +
         " never change sides: they lie on the cloth without being bound";
}

}  // namespace weft::fabric
