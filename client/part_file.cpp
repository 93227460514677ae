#include "client/part_file.h"

#include <cerrno>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/descriptor.h"

namespace weft::client {

using core::throw_errno;

PartFile::PartFile(std::filesystem::path path) : path_(std::move(path)) {
  while (true) {
    file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (file_ < 0) {
      throw_errno("write", path_);
    }
    if (::flock(file_, LOCK_EX) != 0) {
      ::close(file_);
      throw_errno("lock", path_);
    }
    // Whoever held it before may have renamed it: then it is a finished file, not ours to touch.
    struct stat held {};
    struct stat named {};
    if (::fstat(file_, &held) == 0 && ::stat(path_.c_str(), &named) == 0 &&
        held.st_ino == named.st_ino) {
      return;
    }
    ::close(file_);
  }
}

PartFile::~PartFile() { ::close(file_); }

std::uint64_t PartFile::size_bytes() const {
  struct stat held {};
  if (::fstat(file_, &held) != 0) {
    throw_errno("read", path_);
  }
  return static_cast<std::uint64_t>(held.st_size);
}

void PartFile::shorten(std::uint64_t size_bytes) {
  if (::ftruncate(file_, static_cast<off_t>(size_bytes)) != 0) {
    throw_errno("shorten", path_);
  }
}

void PartFile::append(std::string_view data) {
  if (::lseek(file_, 0, SEEK_END) < 0) {
    throw_errno("write", path_);
  }
  while (!data.empty()) {
    const ssize_t n = ::write(file_, data.data(), data.size());
    if (n < 0 && errno != EINTR) {
      throw_errno("write", path_);
    }
    data.remove_prefix(n > 0 ? static_cast<std::size_t>(n) : 0);
  }
}

}  // namespace weft::client
