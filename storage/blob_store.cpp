#include "storage/blob_store.h"

#include <algorithm>
#include <atomic>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"
#include "core/file.h"
#include "core/file_fault.h"
#include "core/folder.h"

namespace weft::storage {

namespace {

constexpr const char* kTrash = "trash";
constexpr const char* kIncoming = "incoming";
constexpr std::int64_t kMsPerSecond = 1000;
constexpr std::int64_t kNsPerMs = 1'000'000;

// By the clock of the file system, which is that of core::system_clock.
bool touch(const std::filesystem::path& path) {
  return ::utimensat(AT_FDCWD, path.c_str(), nullptr, 0) == 0;
}

struct FileFacts {
  std::uint64_t size_bytes = 0;
  std::int64_t modified_at_ms = 0;
};

std::optional<FileFacts> facts_of(const std::filesystem::path& path) {
  struct stat facts {};
  if (::stat(path.c_str(), &facts) != 0 || !S_ISREG(facts.st_mode)) {
    return std::nullopt;
  }
  return FileFacts{static_cast<std::uint64_t>(facts.st_size),
                   facts.st_mtim.tv_sec * kMsPerSecond + facts.st_mtim.tv_nsec / kNsPerMs};
}

// Names of what a folder holds, sorted; nothing when it is not there.
std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code failure;
  for (const auto& item : std::filesystem::directory_iterator(folder, failure)) {
    names.push_back(item.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

void visit_folder(const std::filesystem::path& folder, const BlobStore::Visit& visit) {
  for (const std::string& first : names_in(folder)) {
    if (first.size() != 2) {
      continue;  // the trash, what is incoming
    }
    for (const std::string& rest : names_in(folder / first)) {
      const std::optional<core::Digest> digest = core::Digest::from_hex(first + rest);
      const std::optional<FileFacts> facts = facts_of(folder / first / rest);
      if (digest && facts) {
        visit({*digest, facts->size_bytes, facts->modified_at_ms});
      }
    }
  }
}

// In a folder that several processes write to.
std::string unique_name() {
  static std::atomic<std::uint64_t> counter{0};
  return std::to_string(::getpid()) + "." + std::to_string(++counter);
}

std::filesystem::path path_in(const std::filesystem::path& folder, const core::Digest& digest) {
  const std::string hex = digest.hex();
  return folder / hex.substr(0, 2) / hex.substr(2);
}

}  // namespace

BlobStore::BlobStore(std::filesystem::path folder) : folder_(std::move(folder)) {
  core::make_folder(folder_);
}

std::filesystem::path BlobStore::path_of(const core::Digest& digest) const {
  return path_in(folder_, digest);
}

std::filesystem::path BlobStore::trash_path_of(const core::Digest& digest) const {
  return path_in(folder_ / kTrash, digest);
}

core::Digest BlobStore::put(std::string_view data) {
  const core::Digest digest = core::digest_of(data);
  put(digest, data);
  return digest;
}

void BlobStore::put(const core::Digest& digest, std::string_view data) {
  // A file of another length is damaged and is written again; one of the right length is trusted
  // here and checked by get().
  if (use(digest) == data.size()) {
    return;
  }
  const std::filesystem::path path = path_of(digest);
  core::make_folder(path.parent_path());
  core::write_file_atomically(path, data);
}

BlobStore::Batch::Batch(BlobStore& store)
    : store_(store), files_(store.folder() / kIncoming / unique_name()) {}

bool BlobStore::Batch::put(const core::Digest& digest, std::string_view data) {
  if (own_.contains(digest) || (store_.use(digest) && store_.get(digest))) {
    return true;
  }
  const std::filesystem::path path = store_.path_of(digest);
  core::make_folder(path.parent_path());
  files_.write(path, data);
  own_.insert(digest);
  return false;
}

void BlobStore::Batch::commit() { files_.commit(); }

void BlobStore::remove_unfinished() const {
  std::error_code ignored;
  std::filesystem::remove_all(folder_ / kIncoming, ignored);
}

void BlobStore::adopt(const std::filesystem::path& file, const core::Digest& digest) {
  const std::filesystem::path path = path_of(digest);
  core::make_folder(path.parent_path());
  touch(file);
  core::publish_file(file, path);
}

std::optional<std::string> BlobStore::get(const core::Digest& digest) const {
  if (!has(digest) && !use(digest)) {
    return std::nullopt;
  }
  std::string data;
  try {
    data = core::read_file(path_of(digest));
  } catch (const core::Error& error) {
    if (error.code() == core::Code::kNotFound) {
      return std::nullopt;
    }
    throw;
  }
  if (core::digest_of(data) != digest) {
    remove(digest);
    return std::nullopt;
  }
  return data;
}

bool BlobStore::has(const core::Digest& digest) const {
  return facts_of(path_of(digest)).has_value();
}

std::optional<std::uint64_t> BlobStore::use(const core::Digest& digest) const {
  const std::filesystem::path path = path_of(digest);
  const std::lock_guard lock(mutex_);
  if (!touch(path) && !restore(digest)) {
    return std::nullopt;
  }
  const std::optional<FileFacts> facts = facts_of(path);
  return facts ? std::optional(facts->size_bytes) : std::nullopt;
}

bool BlobStore::restore(const core::Digest& digest) const {
  const std::filesystem::path kept = trash_path_of(digest);
  if (!touch(kept)) {
    return false;
  }
  const std::filesystem::path path = path_of(digest);
  core::make_folder(path.parent_path());
  return core::file_system::rename(kept, path) == 0;
}

void BlobStore::remove(const core::Digest& digest) const {
  (void)core::file_system::remove(path_of(digest));  // it may be gone already
}

void BlobStore::visit(const Visit& visit) const { visit_folder(folder_, visit); }

void BlobStore::visit_trash(const Visit& visit) const { visit_folder(folder_ / kTrash, visit); }

bool BlobStore::trash(const core::Digest& digest, std::int64_t before_ms) const {
  const std::filesystem::path path = path_of(digest);
  const std::filesystem::path kept = trash_path_of(digest);
  core::make_folder(kept.parent_path());
  const std::lock_guard lock(mutex_);
  const std::optional<FileFacts> facts = facts_of(path);
  // Touched first: the time in the trash counts from now even if the process dies in between.
  if (!facts || facts->modified_at_ms >= before_ms || !touch(path)) {
    return false;
  }
  return core::file_system::rename(path, kept) == 0;
}

bool BlobStore::empty(const core::Digest& digest, std::int64_t before_ms) const {
  const std::filesystem::path kept = trash_path_of(digest);
  const std::lock_guard lock(mutex_);
  const std::optional<FileFacts> facts = facts_of(kept);
  return facts && facts->modified_at_ms < before_ms && core::file_system::remove(kept) == 0;
}

}  // namespace weft::storage
