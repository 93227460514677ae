#include "security/private_file.h"

#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"
#include "core/file.h"

namespace weft::security {

namespace {

[[noreturn]] void fail(const std::filesystem::path& path) {
  throw core::Error(core::Code::kUnavailable,
                    "cannot write " + path.string() + ": " +
                        std::strerror(errno));  // NOLINT(concurrency-mt-unsafe)
}

}  // namespace

void make_private_folder(const std::filesystem::path& folder) {
  std::error_code failure;
  if (std::filesystem::is_directory(folder, failure)) {
    return;
  }
  if (folder.has_parent_path()) {
    std::filesystem::create_directories(folder.parent_path(), failure);
  }
  if (mkdir(folder.c_str(), S_IRWXU) != 0 && errno != EEXIST) {
    fail(folder);
  }
}

void write_private_file(const std::filesystem::path& path, std::string_view data) {
  const std::filesystem::path beside = path.string() + ".new";
  unlink(beside.c_str());
  const int file = open(beside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (file < 0) {
    fail(path);
  }
  bool is_written = true;
  while (!data.empty() && is_written) {
    const ssize_t count = write(file, data.data(), data.size());
    is_written = count > 0;
    data.remove_prefix(is_written ? static_cast<std::size_t>(count) : 0);
  }
  if (close(file) != 0 || !is_written) {
    unlink(beside.c_str());
    fail(path);
  }
  core::publish_file(beside, path);  // which syncs it
}

}  // namespace weft::security
