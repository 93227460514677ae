#include "storage/blob_uploads.h"

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"
#include "core/folder.h"

namespace weft::storage {

namespace {

constexpr std::size_t kHashBytes = std::size_t{1} << 20;
constexpr std::uint64_t kAheadBytes = std::uint64_t{8} << 20;

struct Part {
  std::int64_t grown_at_ms = 0;
  core::Digest digest;
  std::uint64_t size_bytes = 0;

  auto operator<=>(const Part&) const = default;  // NOLINT(modernize-use-nullptr)
};

}  // namespace

BlobUploads::BlobUploads(BlobStore& store, UploadLimits limits)
    : store_(store), folder_(store.folder() / "uploads"), limits_(limits) {
  core::make_folder(folder_);
}

std::filesystem::path BlobUploads::path_of(const core::Digest& digest) const {
  return folder_ / digest.hex();
}

std::uint64_t BlobUploads::committed_bytes(const core::Digest& digest) const {
  std::error_code failure;
  const std::uintmax_t size = std::filesystem::file_size(path_of(digest), failure);
  return failure ? 0 : size;
}

std::unique_ptr<BlobUpload> BlobUploads::begin(const core::Digest& digest, std::uint64_t size_bytes,
                                               std::uint64_t offset) {
  {
    const std::lock_guard lock(mutex_);
    if (!active_.insert(digest).second) {
      return nullptr;
    }
  }
  try {
    if (offset != 0 && (offset != committed_bytes(digest) || offset > size_bytes)) {
      throw core::Error(core::Code::kInvalidArgument, "the upload may begin at 0 or go on at " +
                                                          std::to_string(committed_bytes(digest)) +
                                                          ", not at " + std::to_string(offset));
    }
    core::make_folder(folder_);  // somebody may have wiped the blobs
    return std::make_unique<BlobUpload>(*this, digest, size_bytes, offset);
  } catch (...) {
    end(digest);
    throw;
  }
}

void BlobUploads::end(const core::Digest& digest) {
  const std::lock_guard lock(mutex_);
  active_.erase(digest);
}

std::size_t BlobUploads::sweep(std::int64_t before_ms) {
  std::vector<Part> parts;
  std::uint64_t bytes = 0;
  std::error_code failure;
  for (const auto& item : std::filesystem::directory_iterator(folder_, failure)) {
    const auto digest = core::Digest::from_hex(item.path().filename().string());
    struct stat facts {};
    if (digest && ::stat(item.path().c_str(), &facts) == 0) {
      parts.push_back({std::int64_t{facts.st_mtim.tv_sec} * 1000, *digest,
                       static_cast<std::uint64_t>(facts.st_size)});
      bytes += parts.back().size_bytes;
    }
  }
  std::sort(parts.begin(), parts.end());
  std::size_t count = parts.size();
  std::size_t dropped = 0;
  for (const Part& part : parts) {
    if (part.grown_at_ms >= before_ms && count <= limits_.kept && bytes <= limits_.kept_bytes) {
      break;
    }
    const std::lock_guard lock(mutex_);
    if (!active_.contains(part.digest) && std::filesystem::remove(path_of(part.digest), failure)) {
      ++dropped;
      --count;
      bytes -= part.size_bytes;
    }
  }
  return dropped;
}

BlobUpload::BlobUpload(BlobUploads& uploads, const core::Digest& digest, std::uint64_t size_bytes,
                       std::uint64_t offset)
    : uploads_(uploads),
      digest_(digest),
      size_bytes_(size_bytes),
      path_(uploads.path_of(digest)),
      file_(::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
  if (file_ < 0) {
    fail("open");
  }
  if (::ftruncate(file_, static_cast<off_t>(offset)) != 0) {
    abandon("shorten");
  }
  std::string buffer(static_cast<std::size_t>(std::min<std::uint64_t>(kHashBytes, offset)), '\0');
  while (come_bytes_ < offset) {
    const ssize_t n = ::read(file_, buffer.data(), buffer.size());
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n <= 0) {
      drop();
      ::close(file_);
      throw core::Error(core::Code::kDataLoss, "what was kept of blob " + digest_.hex() +
                                                   " cannot be read; begin again at 0");
    }
    hasher_.bytes(std::string_view(buffer).substr(0, static_cast<std::size_t>(n)));
    come_bytes_ += static_cast<std::uint64_t>(n);
  }
}

BlobUpload::~BlobUpload() {
  ::close(file_);
  uploads_.end(digest_);
}

void BlobUpload::fail(const char* doing) const {
  const bool is_full = errno == ENOSPC || errno == EDQUOT;
  throw core::Error(is_full ? core::Code::kResourceExhausted : core::Code::kUnavailable,
                    std::string("cannot ") + doing + " " + path_.string() + ": " +
                        std::generic_category().message(errno));
}

void BlobUpload::add(std::string_view bytes) {
  if (bytes.size() > size_bytes_ - come_bytes_) {
    drop();
    throw core::Error(core::Code::kDataLoss, "more bytes came than were announced");
  }
  hasher_.bytes(bytes);
  while (!bytes.empty()) {
    const ssize_t n = ::write(file_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n < 0) {
      fail("write");
    }
    bytes.remove_prefix(static_cast<std::size_t>(n));
    come_bytes_ += static_cast<std::uint64_t>(n);
    unstarted_bytes_ += static_cast<std::uint64_t>(n);
  }
  // The disk works while further bytes come, and finish() waits for the last of them only.
  if (unstarted_bytes_ >= kAheadBytes) {
    (void)::sync_file_range(file_, static_cast<off_t>(come_bytes_ - unstarted_bytes_),
                            static_cast<off_t>(unstarted_bytes_), SYNC_FILE_RANGE_WRITE);
    unstarted_bytes_ = 0;
  }
}

void BlobUpload::abandon(const char* doing) const {
  const int cause = errno;
  ::close(file_);
  errno = cause;
  fail(doing);
}

void BlobUpload::drop() {
  (void)::ftruncate(file_, 0);
  std::error_code gone;
  std::filesystem::remove(path_, gone);
}

void BlobUpload::finish() {
  if (come_bytes_ != size_bytes_) {
    throw core::Error(core::Code::kDataLoss,
                      "fewer bytes came than were announced: " + std::to_string(come_bytes_) +
                          " of " + std::to_string(size_bytes_));
  }
  if (hasher_.finish() != digest_) {
    drop();
    throw core::Error(core::Code::kDataLoss,
                      "the bytes are not those of blob " + digest_.hex() + "; nothing was stored");
  }
  uploads_.store_.adopt(path_, digest_);
}

}  // namespace weft::storage
