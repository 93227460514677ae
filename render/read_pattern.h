#pragma once

#include "proto/weft/v1/scene.pb.h"
#include "render/cloth_fabric.h"
#include "render/file_source.h"

namespace weft::render {

inline constexpr int kMostPatternFabrics = 36;
inline constexpr std::uint32_t kPatternSideLimit = 4096;

// The matrix of a pattern, its picture read from `files` where it has one; the size of a block is
// not set. Throws core::Error: kInvalidArgument when it names a fabric that is not there, is ragged
// or empty, or the picture has neither a palette nor as many grey levels as there are fabrics;
// kNotFound and kDataLoss for pictures that are missing or damaged.
[[nodiscard]] BlockPattern pattern_of(const v1::Pattern& pattern,
                                      const FileSource& files = files_on_disk());

}  // namespace weft::render
