#pragma once

#include <filesystem>
#include <string_view>

namespace weft::security {

// Makes a folder, and those above it, that its owner alone may enter. One that is there stays as it
// is. Throws core::Error(kUnavailable).
void make_private_folder(const std::filesystem::path& folder);

// As core::write_file_atomically, but from its first byte on its owner alone may read the file.
void write_private_file(const std::filesystem::path& path, std::string_view data);

}  // namespace weft::security
