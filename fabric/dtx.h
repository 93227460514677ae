#pragma once

#include <string>
#include <string_view>

#include "fabric/wif.h"

namespace weft::fabric {

// Reads a draft as Fiberworks writes it (.dtx). Its maker has published no specification; what is
// read here is what public readers of such files agree on (r-owen/dtx_to_wif, John Horigan's
// DrawBoy): sections "@@Name", marks "%%key value", and in them
//   Info          %%shafts, %%treadles, %%ends, %%picks
//   Threading     the shaft of every end; 0: none
//   Tieup         a row of 0 and 1 per shaft, the last row is shaft 1; a column per treadle
//   Treadling     the treadles of every pick, with commas between those of one pick
//   Liftplan      a row of 0 and 1 per pick, a column per shaft
//   Color Palet   a line r,g,b per colour; Warp Colors, Weft Colors number them from 0
//   Warp Spacing, Weft Spacing   whole numbers of 0.53 mm; 4 for threads beyond its end
// "%%sinking" (or "%%%%sinking") in the tie-up or lift plan says that shafts sink. Sections beyond
// these are named in the notes and ignored. Throws core::Error(kInvalidArgument), "name:line:
// @@Section what is wrong; how to mend it", where the draft cannot be told.
[[nodiscard]] WifDraft read_dtx(std::string_view text, const std::string& name);

// Whether the text begins as such a file does.
[[nodiscard]] bool looks_like_dtx(std::string_view text);

}  // namespace weft::fabric
