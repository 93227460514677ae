#include "core/file_batch.h"

#include <cerrno>
#include <string>
#include <system_error>

#include <fcntl.h>

#include "core/file_fault.h"
#include "core/folder.h"

namespace weft::core {

FileBatch::Folder::Folder(std::filesystem::path where) : path(std::move(where)) {
  make_folder(path);
}

FileBatch::Folder::~Folder() {
  std::error_code ignored;
  std::filesystem::remove_all(path, ignored);
}

FileBatch::FileBatch(std::filesystem::path folder)
    : folder_(std::move(folder)), file_system_(folder_.path, O_RDONLY | O_DIRECTORY) {}

void FileBatch::write(std::filesystem::path path, std::string_view data) {
  const std::filesystem::path beside = folder_.path / std::to_string(moves_.size());
  const Descriptor file(beside, O_WRONLY | O_CREAT | O_TRUNC);
  if (!file.write(data)) {
    throw_errno("write", path);
  }
  moves_.emplace_back(beside, std::move(path));
}

void FileBatch::commit() {
  if (!moves_.empty()) {
    sync_all();
  }
  for (const auto& [from, to] : moves_) {
    if (file_system::rename(from, to) != 0) {
      throw_errno("rename to", to);
    }
  }
  sync_all();
}

void FileBatch::sync_all() const {
  if (file_system::sync_all(file_system_.value(), folder_.path) != 0) {
    throw_errno("sync the file system of", folder_.path);
  }
}

}  // namespace weft::core
