#include "worker/input_cache.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"
#include "proto/limits.h"

namespace weft::worker {

InputCache::InputCache(std::filesystem::path folder, std::uint64_t limit_bytes, BlobClient& client)
    : folder_(std::move(folder)), limit_bytes_(limit_bytes), client_(client) {
  core::make_folder(folder_, "name another with --scratch");
  std::error_code failure;
  for (const auto& item : std::filesystem::directory_iterator(folder_, failure)) {
    const auto digest = core::Digest::from_hex(item.path().filename().string());
    std::error_code gone;
    const std::uint64_t size_bytes = item.file_size(gone);
    if (digest && !gone) {
      entries_.push_back({*digest, size_bytes});
      total_bytes_ += size_bytes;
    }
  }
}

std::filesystem::path InputCache::path_of(const core::Digest& digest) const {
  return folder_ / digest.hex();
}

std::optional<std::string> InputCache::read_from_disk(const core::Digest& digest) const {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path_of(digest), failure)) {
    return std::nullopt;
  }
  try {
    std::string data = core::read_file(path_of(digest), v1::kBlobLimitBytes);
    if (core::digest_of(data) == digest) {
      return data;
    }
  } catch (const core::Error&) {
    return std::nullopt;  // gone since, or not readable: the coordinator has it
  }
  return std::nullopt;
}

std::string InputCache::read(const core::Digest& digest, const std::function<bool()>& should_stop) {
  if (std::optional<std::string> data = read_from_disk(digest)) {
    touch(digest, data->size());
    return *std::move(data);
  }
  std::string data = client_.read(digest, should_stop);
  try {
    core::write_file_atomically(path_of(digest), data);
    touch(digest, data.size());
  } catch (const core::Error& error) {
    // The work can go on without a cache.
    spdlog::warn("scratch={} blob={} state=not_cached error=\"{}\"", folder_.string(), digest.hex(),
                 error.what());
  }
  return data;
}

void InputCache::touch(const core::Digest& digest, std::uint64_t size_bytes) {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& entry) { return entry.digest == digest; });
  if (found != entries_.end()) {
    entries_.splice(entries_.begin(), entries_, found);
  } else {
    entries_.push_front({digest, size_bytes});
    total_bytes_ += size_bytes;
  }
  while (total_bytes_ > limit_bytes_ && entries_.size() > 1) {
    std::error_code gone;  // another worker with this folder may have removed it
    std::filesystem::remove(path_of(entries_.back().digest), gone);
    total_bytes_ -= entries_.back().size_bytes;
    entries_.pop_back();
  }
}

}  // namespace weft::worker
