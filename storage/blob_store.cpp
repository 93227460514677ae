#include "storage/blob_store.h"

#include <system_error>

#include "core/error.h"
#include "core/file.h"

namespace weft::storage {

namespace {

void make_folder(const std::filesystem::path& folder) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) {
    throw core::Error(core::Code::kUnavailable,
                      "cannot create the folder " + folder.string() + ": " + failure.message());
  }
}

}  // namespace

BlobStore::BlobStore(std::filesystem::path folder) : folder_(std::move(folder)) {
  make_folder(folder_);
}

std::filesystem::path BlobStore::path_of(const core::Digest& digest) const {
  const std::string hex = digest.hex();
  return folder_ / hex.substr(0, 2) / hex.substr(2);
}

core::Digest BlobStore::put(std::string_view data) {
  const core::Digest digest = core::digest_of(data);
  const std::filesystem::path path = path_of(digest);
  std::error_code failure;
  // A file of another length is damaged and is written again; one of the right length is trusted
  // here and checked by get().
  if (std::filesystem::file_size(path, failure) == data.size() && !failure) {
    return digest;
  }
  make_folder(path.parent_path());
  core::write_file_atomically(path, data);
  return digest;
}

std::optional<std::string> BlobStore::get(const core::Digest& digest) const {
  const std::filesystem::path path = path_of(digest);
  std::string data;
  try {
    data = core::read_file(path);
  } catch (const core::Error& error) {
    if (error.code() == core::Code::kNotFound) {
      return std::nullopt;
    }
    throw;
  }
  if (core::digest_of(data) != digest) {
    std::error_code failure;
    std::filesystem::remove(path, failure);
    return std::nullopt;
  }
  return data;
}

bool BlobStore::has(const core::Digest& digest) const {
  std::error_code failure;
  return std::filesystem::is_regular_file(path_of(digest), failure);
}

}  // namespace weft::storage
