#pragma once

#include <filesystem>

namespace weft::cli {

// Throws core::Error when no file can be written at `path`, before any work is done for it:
// kInvalidArgument when it is a folder, kNotFound when its folder is missing, kPermissionDenied
// when nothing may be written there.
void check_output_file(const std::filesystem::path& path);

}  // namespace weft::cli
