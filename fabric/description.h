#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// Reads a description, protobuf text (.textproto, .txtpb) or JSON (.json), inlines every file it
// names, fills presets and defaults, and checks it. What returns is canonical: self-contained,
// every default expanded, ready to be planned and digested. `quality` other than unspecified
// overrides the description's own. Throws core::Error(kInvalidArgument) whose message lists every
// mistake, one per line, as "file:line:column: what is wrong; what would be right" (text) or "file:
// field.path: ..." (JSON).
[[nodiscard]] v1::FabricDescription load_description(const std::filesystem::path& path,
                                                     v1::Quality quality = v1::QUALITY_UNSPECIFIED);

// The same from memory; `name` stands for the file in messages, `folder` is where the files that it
// names are looked for.
[[nodiscard]] v1::FabricDescription parse_description(
    std::string_view text, const std::string& name, const std::filesystem::path& folder,
    v1::Quality quality = v1::QUALITY_UNSPECIFIED);

// Checks a canonical description that came over the wire: same rules, no files.
void check_description(const v1::FabricDescription& description);

// Only what the geometry reads: no optics, no precompute settings, no name, no comment. Two
// descriptions with equal parts have the same fibres.
[[nodiscard]] v1::FabricDescription geometry_part(const v1::FabricDescription& description);

}  // namespace weft::fabric
