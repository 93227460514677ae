#include "client/fabric_cache.h"

#include <algorithm>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>

#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"
#include "storage/pieces.h"

namespace weft::client {
namespace {

constexpr const char* kPieces = ".pieces";

struct Entry {
  std::filesystem::file_time_type used_at;
  std::filesystem::path path;
  std::uint64_t size_bytes = 0;
};

// Another process may trim at the same time: what has gone meanwhile is left out.
std::vector<Entry> entries_of(const std::filesystem::path& folder) {
  std::vector<Entry> entries;
  std::error_code failure;
  for (const auto& item : std::filesystem::directory_iterator(folder, failure)) {
    std::error_code gone;
    const std::uint64_t size_bytes = item.file_size(gone);
    const auto used_at = item.last_write_time(gone);
    if (!gone) {
      entries.push_back({used_at, item.path(), size_bytes});
    }
  }
  return entries;
}

std::uint64_t total_of(const std::vector<Entry>& entries) {
  std::uint64_t total_bytes = 0;
  for (const Entry& entry : entries) {
    total_bytes += entry.size_bytes;
  }
  return total_bytes;
}

}  // namespace

FabricCache::FabricCache(std::filesystem::path folder, std::uint64_t limit_bytes)
    : folder_(std::move(folder)), limit_bytes_(limit_bytes) {}

PieceIndex FabricCache::pieces() const {
  PieceIndex index;
  for (const Entry& entry : entries_of(folder_)) {
    if (entry.path.extension() != kPieces) {
      continue;
    }
    try {
      index.add_file(std::filesystem::path(entry.path).replace_extension(),
                     storage::decode_pieces(core::read_file(entry.path)));
    } catch (const core::Error&) {
      continue;  // it went meanwhile, or is damaged: those pieces are fetched
    }
  }
  return index;
}

std::uint64_t FabricCache::size_bytes() const { return total_of(entries_of(folder_)); }

std::filesystem::path FabricCache::fetch(Coordinator& coordinator, const v1::Version& version,
                                         const FetchReport& report) const {
  if (version.size_bytes() > limit_bytes_) {
    throw core::Error(core::Code::kResourceExhausted,
                      reference_text(version) + " has " + std::to_string(version.size_bytes()) +
                          " bytes, and the cache of fabrics holds " + std::to_string(limit_bytes_) +
                          "; give the cache a larger limit");
  }
  core::make_folder(folder_);
  std::filesystem::path path = folder_ / (version_digest(version).hex() + ".h5");
  const FetchOutcome outcome = fetch_version(coordinator, version, path, report, pieces());
  if (!outcome.pieces.empty()) {
    core::write_file_atomically(path.string() + kPieces, storage::encode_pieces(outcome.pieces));
  }
  (void)::utimensat(AT_FDCWD, path.c_str(), nullptr, 0);  // used now; no matter if it fails
  trim(path);
  return path;
}

void FabricCache::trim(const std::filesystem::path& kept) const {
  std::vector<Entry> entries = entries_of(folder_);
  std::uint64_t total_bytes = total_of(entries);
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return std::tie(a.used_at, a.path) < std::tie(b.used_at, b.path);
  });
  for (const Entry& entry : entries) {
    if (total_bytes <= limit_bytes_) {
      return;
    }
    if (entry.path != kept && entry.path != kept.string() + kPieces) {
      std::error_code gone;
      std::filesystem::remove(entry.path, gone);
      std::filesystem::remove(entry.path.string() + kPieces, gone);
      total_bytes -= entry.size_bytes;
    }
  }
}

}  // namespace weft::client
