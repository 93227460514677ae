#include "core/descriptor.h"

#include <cerrno>
#include <system_error>

#include <unistd.h>

#include "core/error.h"
#include "core/file_fault.h"

namespace weft::core {

void throw_errno(const std::string& what, const std::filesystem::path& path) {
  throw Error(Code::kUnavailable, "cannot " + what + " " + path.string() + ": " +
                                      std::generic_category().message(errno));
}

Descriptor::Descriptor(const std::filesystem::path& path, int flags)
    : path_(path), value_(file_system::open(path, flags)) {
  if (value_ < 0) {
    throw_errno("open", path);
  }
}

Descriptor::~Descriptor() { ::close(value_); }

bool Descriptor::write(std::string_view data) const {
  while (!data.empty()) {
    const ssize_t n = file_system::write(value_, path_, data.data(), data.size());
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n < 0) {
      return false;
    }
    data.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

void Descriptor::sync() const {
  if (file_system::sync(value_, path_) != 0) {
    throw_errno("sync", path_);
  }
}

}  // namespace weft::core
