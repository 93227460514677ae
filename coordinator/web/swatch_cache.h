#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>

namespace weft::coordinator {

// Thumbnails on the disk, by name; when they get too many, those that were used longest ago go.
// They can all be drawn again: nothing is synced, and what goes wrong is only logged. Any thread.
class SwatchCache {
 public:
  // Throws core::Error(kUnavailable) when the folder cannot be made.
  SwatchCache(std::filesystem::path folder, std::uint64_t limit_bytes);

  // REQUIRES of both: `name` is [0-9a-z-]{1,128}.
  [[nodiscard]] std::optional<std::string> find(const std::string& name);
  void keep(const std::string& name, const std::string& png);

 private:
  void make_room(std::uint64_t bytes);  // REQUIRES: mutex_ is held
  [[nodiscard]] std::filesystem::path path_of(const std::string& name) const;

  const std::filesystem::path folder_;
  const std::uint64_t limit_bytes_;
  std::mutex mutex_;  // the folder's
};

}  // namespace weft::coordinator
