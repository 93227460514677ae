#pragma once

#include "core/mistakes.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// Lists every mistake of meaning in a description whose files are inlined, presets filled in and
// defaults expanded: numbers out of range, names that are missing, unknown or used twice, drafts
// that are broken. Builds no geometry.
[[nodiscard]] core::Mistakes check_fields(const v1::FabricDescription& description);

// Whether a text can name a fabric, a yarn or a material: [a-z0-9][a-z0-9_-]{0,63}.
[[nodiscard]] bool is_name(std::string_view text);

}  // namespace weft::fabric
