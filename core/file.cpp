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
  const auto require_within = [&](std::uint64_t bytes) {
    if (bytes > limit_bytes) {
      throw Error(Code::kResourceExhausted, path.string() + " is larger than the limit of " +
                                                std::to_string(limit_bytes) + " bytes");
    }
  };
  // As much as the file says it holds at once; what it does not tell, as pipes do not, bit by bit.
  std::string data;
  const std::uint64_t stated_bytes = std::filesystem::file_size(path, failure);
  if (!failure) {
    require_within(stated_bytes);
    data.resize(stated_bytes);
    in.read(data.data(), static_cast<std::streamsize>(stated_bytes));
    data.resize(static_cast<std::size_t>(in.gcount()));
  }
  std::string buffer;
  while (in && in.peek() != std::ifstream::traits_type::eof()) {
    buffer.resize(1 << 16);
    in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    data.append(buffer, 0, static_cast<std::size_t>(in.gcount()));
    require_within(data.size());
  }
  return data;
}

void write_file_unsynced(const std::filesystem::path& path, std::string_view data) {
  const Descriptor file(path, O_WRONLY | O_CREAT | O_TRUNC);
  if (!file.write(data)) {
    throw_errno("write", path);
  }
  // The disk may begin; whoever syncs waits for less.
  (void)::sync_file_range(file.value(), 0, 0, SYNC_FILE_RANGE_WRITE);
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
