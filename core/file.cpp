#include "core/file.h"

#include <atomic>
#include <cerrno>
#include <fstream>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/file_fault.h"

namespace weft::core {

namespace {

std::filesystem::path folder_of(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

}  // namespace

std::string read_file(const std::filesystem::path& path, std::uint64_t limit_bytes) {
  std::error_code failure;
  const bool is_folder = std::filesystem::is_directory(path, failure);
  std::ifstream in(path, std::ios::binary);
  if (!in || is_folder) {
    throw Error(Code::kNotFound, "cannot read " + path.string() +
                                     (is_folder ? ": it is a folder" : ": no such file"));
  }
  std::string data;
  std::string buffer(1 << 16, '\0');
  while (in) {
    in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    data.append(buffer, 0, static_cast<std::size_t>(in.gcount()));
    if (data.size() > limit_bytes) {
      throw Error(Code::kResourceExhausted, path.string() + " is larger than the limit of " +
                                                std::to_string(limit_bytes) + " bytes");
    }
  }
  return data;
}

void write_file_atomically(const std::filesystem::path& path, std::string_view data) {
  static std::atomic<std::uint64_t> counter{0};
  const std::filesystem::path beside =
      path.string() + "." + std::to_string(::getpid()) + "." + std::to_string(++counter) + ".part";
  {
    const Descriptor file(beside, O_WRONLY | O_CREAT | O_TRUNC);
    if (!file.write(data)) {
      const int cause = errno;
      ::unlink(beside.c_str());
      errno = cause;
      throw_errno("write", path);
    }
  }
  publish_file(beside, path);
}

void publish_file(const std::filesystem::path& from, const std::filesystem::path& to) {
  Descriptor(from, O_RDONLY).sync();
  if (file_system::rename(from, to) != 0) {
    throw_errno("rename to", to);
  }
  Descriptor(folder_of(to), O_RDONLY | O_DIRECTORY).sync();
}

}  // namespace weft::core
