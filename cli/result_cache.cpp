#include "cli/result_cache.h"

#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"

namespace weft::cli {

namespace {

constexpr std::size_t kHexLength = 64;
constexpr std::size_t kLineLength = 2 * kHexLength + 2;  // shard, space, result, newline

std::filesystem::path made(const std::filesystem::path& folder) {
  core::make_folder(folder, "name one that can be written with --cache");
  return folder;
}

[[noreturn]] void throw_errno(const std::string& what, const std::filesystem::path& path) {
  throw core::Error(core::Code::kUnavailable, "cannot " + what + " " + path.string() + ": " +
                                                  std::generic_category().message(errno));
}

}  // namespace

ResultCache::ResultCache(const std::filesystem::path& folder)
    : blobs_(made(folder)), index_path_(folder / "index") {
  index_file_ = ::open(index_path_.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
  if (index_file_ < 0) {
    throw_errno("open", index_path_);
  }
  load_index(index_path_);
}

ResultCache::~ResultCache() { ::close(index_file_); }

void ResultCache::load_index(const std::filesystem::path& path) {
  const std::string text = core::read_file(path);
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) {
      // The line of a process that was stopped while writing: close it, so that the next one is
      // whole. It is not the length of an entry and is passed over.
      if (::write(index_file_, "\n", 1) != 1) {
        throw_errno("write", path);
      }
      return;
    }
    const std::string_view line(text.data() + begin, end - begin);
    begin = end + 1;
    if (line.size() + 1 != kLineLength || line[kHexLength] != ' ') {
      continue;
    }
    const auto shard = core::Digest::from_hex(line.substr(0, kHexLength));
    const auto result = core::Digest::from_hex(line.substr(kHexLength + 1));
    if (shard && result) {
      results_[*shard] = *result;
    }
  }
}

std::optional<core::Digest> ResultCache::find(const core::Digest& shard) const {
  std::optional<core::Digest> result;
  {
    const std::lock_guard lock(mutex_);
    const auto found = results_.find(shard);
    if (found == results_.end()) {
      return std::nullopt;
    }
    result = found->second;
  }
  return blobs_.get(*result) ? result : std::nullopt;
}

core::Digest ResultCache::put(const core::Digest& shard, std::string_view result) {
  const core::Digest digest = blobs_.put(result);
  const std::string line = shard.hex() + " " + digest.hex() + "\n";
  const std::lock_guard lock(mutex_);
  // One write of a short line to a file opened for appending is not torn by another process.
  if (::write(index_file_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) {
    throw_errno("write", index_path_);
  }
  results_[shard] = digest;
  return digest;
}

std::string ResultCache::read(const core::Digest& result) const {
  std::optional<std::string> bytes = blobs_.get(result);
  if (!bytes) {
    throw core::Error(core::Code::kDataLoss,
                      "the result " + result.hex() +
                          " has gone from the cache or is damaged; run the same command again: "
                          "what is missing is computed again");
  }
  return *std::move(bytes);
}

FolderLock::FolderLock(const std::filesystem::path& folder) {
  const std::filesystem::path path = made(folder) / "lock";
  file_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (file_ < 0) {
    throw_errno("open", path);
  }
  if (::flock(file_, LOCK_EX | LOCK_NB) != 0) {
    ::close(file_);
    throw core::Error(core::Code::kFailedPrecondition,
                      "another weft run works in " + folder.string() +
                          "; wait for it, or name another output with -o");
  }
}

FolderLock::~FolderLock() { ::close(file_); }

}  // namespace weft::cli
