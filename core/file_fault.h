#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>

#include <sys/types.h>

// The calls by which core/file and core/file_batch write, with a seam: a test can make any of them
// fail. Without a hook each costs one comparison more than the system call.

namespace weft::core {

enum class FileOperation : std::uint8_t {
  kOpen,
  kWrite,
  kSync,
  kSyncAll,  // of the file system that `path` is in
  kRename,
  kRemove,
};

struct FileCall {
  FileOperation operation = FileOperation::kOpen;
  std::filesystem::path path;
  std::filesystem::path to;  // of a rename
};

// What becomes of a call: `error` (an errno) before anything is done, or no more than `limit_bytes`
// of a write.
struct FileFault {
  int error = 0;
  std::size_t limit_bytes = ~std::size_t{0};
};

using FileFaultHook = std::function<FileFault(const FileCall& call)>;

// For tests alone; of the whole process. Null: no faults. The hook must outlive its use, and may be
// called by any thread.
void set_file_fault_hook(const FileFaultHook* hook);

// As the system calls of those names, errno included.
namespace file_system {
[[nodiscard]] int open(const std::filesystem::path& path, int flags);
[[nodiscard]] ssize_t write(int descriptor, const std::filesystem::path& path, const char* data,
                            std::size_t size);
[[nodiscard]] int sync(int descriptor, const std::filesystem::path& path);
[[nodiscard]] int sync_all(int descriptor, const std::filesystem::path& path);
[[nodiscard]] int rename(const std::filesystem::path& from, const std::filesystem::path& to);
[[nodiscard]] int remove(const std::filesystem::path& path);
}  // namespace file_system

}  // namespace weft::core
