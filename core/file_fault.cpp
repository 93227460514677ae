#include "core/file_fault.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>

#include <fcntl.h>
#include <unistd.h>

namespace weft::core {

namespace {

constexpr mode_t kMode = 0666;

std::atomic<const FileFaultHook*> the_hook{nullptr};

FileFault fault_of(FileOperation operation, const std::filesystem::path& path,
                   const std::filesystem::path& to = {}) {
  const FileFaultHook* const hook = the_hook.load(std::memory_order_relaxed);
  if (hook == nullptr) [[likely]] {
    return {};
  }
  const FileFault fault = (*hook)({operation, path, to});
  if (fault.error != 0) {
    errno = fault.error;
  }
  return fault;
}

}  // namespace

void set_file_fault_hook(const FileFaultHook* hook) { the_hook.store(hook); }

namespace file_system {

int open(const std::filesystem::path& path, int flags) {
  if (fault_of(FileOperation::kOpen, path).error != 0) {
    return -1;
  }
  return ::open(path.c_str(), flags | O_CLOEXEC, kMode);
}

ssize_t write(int descriptor, const std::filesystem::path& path, const char* data,
              std::size_t size) {
  const FileFault fault = fault_of(FileOperation::kWrite, path);
  if (fault.error != 0) {
    return -1;
  }
  return ::write(descriptor, data, std::min(size, fault.limit_bytes));
}

int sync(int descriptor, const std::filesystem::path& path) {
  return fault_of(FileOperation::kSync, path).error != 0 ? -1 : ::fsync(descriptor);
}

int sync_all(int descriptor, const std::filesystem::path& path) {
  return fault_of(FileOperation::kSyncAll, path).error != 0 ? -1 : ::syncfs(descriptor);
}

int rename(const std::filesystem::path& from, const std::filesystem::path& to) {
  return fault_of(FileOperation::kRename, from, to).error != 0
             ? -1
             : std::rename(from.c_str(), to.c_str());
}

int remove(const std::filesystem::path& path) {
  return fault_of(FileOperation::kRemove, path).error != 0 ? -1 : ::unlink(path.c_str());
}

}  // namespace file_system

}  // namespace weft::core
