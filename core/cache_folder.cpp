#include "core/cache_folder.h"

#include <cstdlib>

namespace weft::core {

std::filesystem::path cache_folder() {
  // No other thread changes the environment: weft does so before it starts the first.
  const char* cache = std::getenv("XDG_CACHE_HOME");  // NOLINT(concurrency-mt-unsafe)
  if (cache != nullptr && *cache == '/') {
    return std::filesystem::path(cache) / "weft";
  }
  const char* home = std::getenv("HOME");  // NOLINT(concurrency-mt-unsafe)
  if (home != nullptr && *home != '\0') {
    return std::filesystem::path(home) / ".cache" / "weft";
  }
  return {};
}

}  // namespace weft::core
