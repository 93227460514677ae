#pragma once

#include "fabric/wif.h"
#include "fabric/wif_file.h"

namespace weft::fabric {

// Draws the draft down: from threading and lift plan, or threading, tie-up and treadling, and the
// kind of shed, to draft.up. The thread counts are known. Throws by WifFile::fail.
void draw_down(WifFile& file, WifDraft& draft);

}  // namespace weft::fabric
