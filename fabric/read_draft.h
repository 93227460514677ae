#pragma once

#include <string>
#include <string_view>

#include "fabric/wif.h"

namespace weft::fabric {

enum class DraftFormat { kWif, kDtx, kWpo };

// The format that the name's extension tells (.wif, .dtx, .wpo), else the one that the bytes look
// like.
[[nodiscard]] DraftFormat draft_format(std::string_view bytes, const std::string& name);

// Reads a draft of any of the formats: read_wif, read_dtx, read_wpo.
[[nodiscard]] WifDraft read_draft(std::string_view bytes, const std::string& name);

}  // namespace weft::fabric
