#include "storage/blob_reader.h"

#include <algorithm>

#include "core/check.h"
#include "core/error.h"

namespace weft::storage {

namespace {

constexpr std::size_t kSkipBytes = std::size_t{1} << 20;

}  // namespace

std::optional<BlobReader> BlobReader::open(const BlobStore& store, const core::Digest& digest) {
  const std::optional<std::uint64_t> size_bytes = store.use(digest);
  if (!size_bytes) {
    return std::nullopt;
  }
  BlobReader reader(store, digest, *size_bytes);
  if (!reader.file_) {
    return std::nullopt;
  }
  return reader;
}

BlobReader::BlobReader(const BlobStore& store, const core::Digest& digest, std::uint64_t size_bytes)
    : store_(&store),
      digest_(digest),
      size_bytes_(size_bytes),
      file_(store.path_of(digest), std::ios::binary) {}

void BlobReader::skip(std::uint64_t bytes) {
  CHECK(read_bytes_ == 0 && bytes <= size_bytes_);
  while (read_bytes_ < bytes) {
    (void)read(static_cast<std::size_t>(std::min<std::uint64_t>(kSkipBytes, bytes - read_bytes_)));
  }
}

std::string BlobReader::read(std::size_t limit_bytes) {
  const std::uint64_t left = size_bytes_ - read_bytes_;
  std::string bytes(static_cast<std::size_t>(std::min<std::uint64_t>(limit_bytes, left)), '\0');
  bool is_good =
      static_cast<bool>(file_.read(bytes.data(), static_cast<std::streamsize>(bytes.size())));
  read_bytes_ += bytes.size();
  if (!is_checked_) {
    hasher_.bytes(bytes);
    is_checked_ = read_bytes_ == size_bytes_;
    is_good = is_good && (!is_checked_ || hasher_.finish() == digest_);
  }
  if (!is_good) {
    store_->remove(digest_);
    throw core::Error(core::Code::kDataLoss, "blob " + digest_.hex() +
                                                 " was damaged on disk; whatever made it will be "
                                                 "computed again");
  }
  return bytes;
}

}  // namespace weft::storage
