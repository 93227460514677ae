#pragma once

#include <string>

#include "fabric/wif.h"

namespace weft::fabric {

// The draft as a Weaving Information File 1.1 that read_wif reads back: the same crossings, colours
// (of 8 bits each) and mean lengths. Ends that are up at the same picks share a shaft; picks have a
// lift plan. Nothing is said of spacing or thickness where the draft says nothing.
[[nodiscard]] std::string write_wif(const WifDraft& draft);

}  // namespace weft::fabric
