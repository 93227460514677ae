#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace weft::fabric {

// The warp or the weft of a draft.
struct WifThreads {
  std::uint32_t count = 0;
  std::vector<std::uint32_t> colours;  // [count] keys of WifDraft::colours
  double spacing_mm = 0;    // mean distance of two neighbours' axes; 0: the file gives none
  double thickness_mm = 0;  // mean diameter; 0: the file gives none
  bool even = true;         // false: spacing or thickness differ from thread to thread
};

// What a Weaving Information File says about a cloth.
struct WifDraft {
  std::string title;
  std::string source_program;
  WifThreads warp;
  WifThreads weft;
  std::vector<std::uint8_t> up;  // [weft.count, warp.count]: 1 where the warp is on top
  std::map<std::uint32_t, std::array<double, 3>> colours;  // sRGB, [0, 1]
  std::vector<std::string> notes;  // the import report: what was defaulted or repaired
};

// Reads a draft in the format of the WIF specification 1.0 or 1.1 (Nielsen et al. 1996, 1997), or
// the Library's "1.2", as real programs write it. `name` stands for the file in messages. Throws
// core::Error(kInvalidArgument), "name:line: [SECTION] what is wrong; how to mend it", when the
// draft is broken: what lies where cannot be told from it, or it contradicts itself. Gaps with an
// evident meaning are filled and reported in notes.
[[nodiscard]] WifDraft read_wif(std::string_view text, const std::string& name);

}  // namespace weft::fabric
