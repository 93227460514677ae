#pragma once

#include <filesystem>
#include <string_view>

namespace weft::core {

// Makes the folder, and those above it, where they are absent. Throws Error(kUnavailable) that
// names it and ends in `remedy`, what the user can do.
void make_folder(const std::filesystem::path& folder,
                 std::string_view remedy = "name one that can be written");

}  // namespace weft::core
