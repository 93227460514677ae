#include "coordinator/web/swatch_cache.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"

namespace weft::coordinator {

namespace {

constexpr std::uint64_t kFileLimitBytes = std::uint64_t{16} << 20;

}  // namespace

SwatchCache::SwatchCache(std::filesystem::path folder, std::uint64_t limit_bytes)
    : folder_(std::move(folder)), limit_bytes_(limit_bytes) {
  core::make_folder(folder_, "name another with --state");
}

std::filesystem::path SwatchCache::path_of(const std::string& name) const {
  CHECK(!name.empty() &&
        name.find_first_not_of("0123456789abcdefghijklmnopqrstuvwxyz-") == std::string::npos);
  return folder_ / (name + ".png");
}

std::optional<std::string> SwatchCache::find(const std::string& name) {
  const std::filesystem::path path = path_of(name);
  const std::lock_guard lock(mutex_);
  std::error_code failure;
  // Its time says when it was used last.
  std::filesystem::last_write_time(path, std::filesystem::file_time_type::clock::now(), failure);
  if (failure) {
    return std::nullopt;
  }
  try {
    return core::read_file(path, kFileLimitBytes);
  } catch (const core::Error& error) {
    spdlog::warn("event=thumbnail_unreadable file={} message=\"{}\"", path.string(), error.what());
    return std::nullopt;
  }
}

void SwatchCache::keep(const std::string& name, const std::string& png) {
  const std::filesystem::path path = path_of(name);
  const std::lock_guard lock(mutex_);
  try {
    make_room(png.size());
    if (png.size() <= limit_bytes_) {
      core::write_file_atomically(path, png);
    }
  } catch (const std::exception& error) {
    spdlog::warn("event=thumbnail_not_kept file={} message=\"{}\"", path.string(), error.what());
  }
}

void SwatchCache::make_room(std::uint64_t bytes) {
  struct Kept {
    std::filesystem::file_time_type used;
    std::filesystem::path path;
    std::uint64_t bytes = 0;
  };
  std::vector<Kept> all;
  std::uint64_t total = bytes;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    std::error_code failure;
    Kept kept{entry.last_write_time(failure), entry.path(), 0};
    kept.bytes = failure ? 0 : entry.file_size(failure);
    if (!failure) {
      total += kept.bytes;
      all.push_back(std::move(kept));
    }
  }
  std::sort(all.begin(), all.end(), [](const Kept& a, const Kept& b) { return a.used < b.used; });
  for (const Kept& kept : all) {
    if (total <= limit_bytes_) {
      return;
    }
    std::error_code failure;
    std::filesystem::remove(kept.path, failure);
    total -= kept.bytes;
  }
}

}  // namespace weft::coordinator
