#pragma once

#include <filesystem>

namespace weft::core {

// Where this user's caches are kept: $XDG_CACHE_HOME/weft, else ~/.cache/weft; empty when neither
// is set.
[[nodiscard]] std::filesystem::path cache_folder();

}  // namespace weft::core
