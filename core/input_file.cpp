#include "core/input_file.h"

#include <cerrno>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"

namespace weft::core {

namespace {

std::string message_of(int cause) { return std::generic_category().message(cause); }

}  // namespace

InputFile::InputFile(const std::filesystem::path& path)
    : name_(path.string()),
      // A named pipe must not make us wait for whoever writes to it.
      descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
  if (descriptor_ < 0) {
    throw Error(Code::kNotFound, "cannot read " + name_ + ": " + message_of(errno));
  }
  struct stat held {};
  if (::fstat(descriptor_, &held) != 0 || !S_ISREG(held.st_mode)) {
    ::close(descriptor_);
    throw Error(S_ISDIR(held.st_mode) ? Code::kNotFound : Code::kInvalidArgument,
                "cannot read " + name_ + ": it is " +
                    (S_ISDIR(held.st_mode) ? "a folder" : "not a plain file"));
  }
  size_bytes_ = static_cast<std::uint64_t>(held.st_size);
}

InputFile::InputFile(std::string_view bytes, std::string name)
    : name_(std::move(name)),
      descriptor_(::memfd_create("weft-input", MFD_CLOEXEC)),
      size_bytes_(bytes.size()) {
  std::size_t written = 0;
  while (descriptor_ >= 0 && written < bytes.size()) {
    const ssize_t n = ::write(descriptor_, bytes.data() + written, bytes.size() - written);
    if (n < 0 && errno != EINTR) {
      break;
    }
    written += n > 0 ? static_cast<std::size_t>(n) : 0;
  }
  if (descriptor_ < 0 || written < bytes.size()) {
    const int cause = errno;
    ::close(descriptor_);
    throw Error(Code::kResourceExhausted,
                "there is no room for a copy of " + name_ + ": " + message_of(cause));
  }
}

InputFile::~InputFile() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
}

InputFile::InputFile(InputFile&& other) noexcept
    : name_(std::move(other.name_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_bytes_(other.size_bytes_) {}

std::size_t InputFile::read_into(std::uint64_t offset, char* data, std::size_t count) const {
  while (true) {
    const ssize_t n = ::pread(descriptor_, data, count, static_cast<off_t>(offset));
    if (n >= 0) {
      return static_cast<std::size_t>(n);
    }
    if (errno != EINTR) {
      throw Error(Code::kUnavailable, "cannot read " + name_ + ": " + message_of(errno));
    }
  }
}

std::string InputFile::read(std::uint64_t offset, std::size_t count) const {
  std::string bytes(count, '\0');
  std::size_t filled = 0;
  while (filled < count) {
    const std::size_t n = read_into(offset + filled, bytes.data() + filled, count - filled);
    if (n == 0) {
      break;
    }
    filled += n;
  }
  bytes.resize(filled);
  return bytes;
}

Digest InputFile::digest(std::uint64_t offset) const {
  constexpr std::size_t kStepBytes = std::size_t{1} << 20;
  Hasher hasher;
  std::vector<char> buffer(kStepBytes);
  for (std::size_t n = 1; n > 0; offset += n) {
    n = read_into(offset, buffer.data(), buffer.size());
    hasher.bytes({buffer.data(), n});
  }
  return hasher.finish();
}

}  // namespace weft::core
