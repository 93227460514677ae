#pragma once

#include <string>
#include <string_view>

#include "fabric/wif.h"

namespace weft::fabric {

// Reads a draft as WeavePoint writes it (.wpo), versions up to 7. The maker has published no
// specification; this is the layout that r-owen/dtx_to_wif reads, whose author had it from the
// maker. All of it is bytes, 16-bit counts are big-endian:
//   0      123
//   1      version; below 4 colours range to 63, else to 255
//   2      100 lift plan, 101 one treadle a pick, 102 several
//   3      zoom
//   4, 5   shafts, treadles
//   7      0: shafts rise
//   9, 10  ends and picks per inch
//   13, 15 ends and picks of the page (16 bits each), which may be more than are drawn
//   24     threading: a count, then the shaft of every end; likewise the warp's colours and the
//          weft's, from 0; then the lift plan, or the tie-up and the treadling; 66 bytes; the
//          number of colours and red, green, blue of each
// A row of shafts or treadles is so many bytes as its bits need, bit 0 of the first is number 1.
// Spacing and thickness of single threads stand in such files, too, where nobody says how: the
// notes tell. Throws core::Error(kInvalidArgument), "name: byte N: what is wrong; how to mend it".
[[nodiscard]] WifDraft read_wpo(std::string_view bytes, const std::string& name);

// Whether the bytes begin as such a file does.
[[nodiscard]] bool looks_like_wpo(std::string_view bytes);

}  // namespace weft::fabric
