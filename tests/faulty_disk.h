#pragma once

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <new>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include <sqlite3.h>
#include <unistd.h>

#include "core/file_fault.h"

namespace weft::coordinator {

// A new folder, "weft_NAME_" and more, in memory where the machine has a place for it: what is
// synced is told by FaultyDisk. Empty when it cannot be made.
inline std::filesystem::path make_fault_folder(const std::string& name) {
  const std::filesystem::path memory = "/dev/shm";
  const bool has_memory = ::access(memory.c_str(), W_OK) == 0;
  const std::filesystem::path place = has_memory ? memory : std::filesystem::temp_directory_path();
  std::string path = (place / ("weft_" + name + "_XXXXXX")).string();
  return ::mkdtemp(path.data()) != nullptr ? path : std::string();
}

// A disk on which one operation goes wrong: under SQLite it is a VFS of its own, the default while
// this lives; under core/file it is the fault hook. Writes, syncs, renames, removals and openings
// for writing are counted together, from 1. There is one at a time.
class FaultyDisk {
 public:
  enum class Fault : std::uint8_t {
    kIoError,     // the nth operation fails with EIO, once
    kFull,        // from the nth on nothing can be written (ENOSPC), until disarm()
    kShortWrite,  // half of the nth write is written, then ENOSPC once; other operations: EIO
    kPowerLoss,   // from the nth on nothing happens any more; see reboot()
  };

  FaultyDisk() {
    the_disk() = this;
    real_ = sqlite3_vfs_find(nullptr);
    vfs_ = *real_;
    vfs_.zName = "faulty";
    vfs_.szOsFile = static_cast<int>(sizeof(File)) + real_->szOsFile;
    vfs_.xOpen = &open;
    vfs_.xDelete = &remove;
    sqlite3_vfs_register(&vfs_, 1);
    hook_ = [this](const core::FileCall& call) { return on_file(call); };
    core::set_file_fault_hook(&hook_);
  }
  ~FaultyDisk() {
    core::set_file_fault_hook(nullptr);
    sqlite3_vfs_unregister(&vfs_);
    sqlite3_vfs_register(real_, 1);
    the_disk() = nullptr;
  }
  FaultyDisk(const FaultyDisk&) = delete;
  FaultyDisk& operator=(const FaultyDisk&) = delete;
  FaultyDisk(FaultyDisk&&) = delete;
  FaultyDisk& operator=(FaultyDisk&&) = delete;

  // The nth operation from now goes wrong; 0: none.
  void arm(std::uint64_t nth, Fault fault) {
    const std::lock_guard lock(mutex_);
    count_ = 0;
    nth_ = nth;
    fault_ = fault;
    has_struck_ = false;
  }
  void disarm() { arm(0, Fault::kIoError); }
  [[nodiscard]] std::uint64_t count() {
    const std::lock_guard lock(mutex_);
    return count_;
  }
  [[nodiscard]] bool has_struck() {
    const std::lock_guard lock(mutex_);
    return has_struck_;
  }
  [[nodiscard]] bool is_without_power() {
    const std::lock_guard lock(mutex_);
    return has_struck_ && fault_ == Fault::kPowerLoss;
  }
  // Nothing reaches the disk from here on: what a process does while it is torn down is not seen.
  void lose_power() {
    const std::lock_guard lock(mutex_);
    nth_ = ++count_;
    fault_ = Fault::kPowerLoss;
    has_struck_ = true;
  }

  // After a power loss, when all files are closed: of what was not synced, a part chosen by `seed`
  // is there and the rest is not, in any order; names given since their folder was synced may be
  // gone, and files renamed without a sync may be torn.
  void reboot(std::uint64_t seed) {
    const std::lock_guard lock(mutex_);
    std::mt19937_64 random(seed);
    for (const auto& [path, writes] : unsynced_) {
      std::string content = read(path);
      for (auto write = writes.rbegin(); write != writes.rend(); ++write) {
        write->undo(content);
      }
      for (const Write& write : writes) {
        if (seed % 3 == 1 || (seed % 3 == 2 && random() % 2 == 0)) {
          write.redo(content);
        }
      }
      std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
    }
    for (const auto& [path, move] : renamed_) {
      std::error_code gone;  // it may have been removed since
      if (random() % 2 == 0 && move.had_a_name) {
        std::filesystem::rename(path, move.from, gone);
      } else if (random() % 2 == 0 && !move.had_a_name) {
        std::filesystem::remove(path, gone);
      } else if (move.is_torn && std::filesystem::exists(path)) {
        std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
      }
    }
    forget();
    nth_ = 0;
    has_struck_ = false;
  }
  // What is in the caches of a running machine survives its processes.
  void forget() {
    unsynced_.clear();
    renamed_.clear();
    synced_.clear();
    written_.clear();
  }

 private:
  struct Write {
    std::size_t offset = 0;
    std::string before;
    std::size_t size_before = 0;
    std::string after;
    bool is_truncation = false;

    void undo(std::string& content) const {
      content.resize(std::max(content.size(), offset + before.size()));
      content.replace(offset, before.size(), before);
      content.resize(size_before);
    }
    void redo(std::string& content) const {
      if (is_truncation) {
        content.resize(offset);
        return;
      }
      content.resize(std::max(content.size(), offset + after.size()));
      content.replace(offset, after.size(), after);
    }
  };
  struct File {
    sqlite3_file base;
    sqlite3_file* real;
    std::string* path;
  };
  struct Move {
    std::string from;
    bool is_torn = false;     // its bytes may be lost
    bool had_a_name = false;  // that was on the disk: it has the old one or the new one
  };
  enum class Outcome : std::uint8_t { kGood, kFails, kFull, kShort };

  static FaultyDisk*& the_disk() {
    static FaultyDisk* disk = nullptr;
    return disk;
  }
  static std::string read(const std::string& path) {
    std::ostringstream out;
    out << std::ifstream(path, std::ios::binary).rdbuf();
    return out.str();
  }

  // REQUIRES: mutex_ is held.
  Outcome next(bool is_write) {
    ++count_;
    if (nth_ == 0 || count_ < nth_) {
      return Outcome::kGood;
    }
    const bool is_first = !has_struck_;
    switch (fault_) {
      case Fault::kIoError:
        has_struck_ = true;
        return is_first ? Outcome::kFails : Outcome::kGood;
      case Fault::kFull:
        has_struck_ = has_struck_ || is_write;
        return is_write ? Outcome::kFull : Outcome::kGood;
      case Fault::kShortWrite:
        has_struck_ = true;
        return !is_first ? Outcome::kGood : is_write ? Outcome::kShort : Outcome::kFails;
      case Fault::kPowerLoss:
        has_struck_ = true;
        return Outcome::kFails;
    }
    return Outcome::kGood;
  }

  core::FileFault on_file(const core::FileCall& call) {
    const std::lock_guard lock(mutex_);
    const bool is_write = call.operation == core::FileOperation::kWrite;
    if (full_next_ && is_write) {
      full_next_ = false;
      return {ENOSPC};
    }
    switch (next(is_write)) {
      case Outcome::kFails:
        return {EIO};
      case Outcome::kFull:
        return {ENOSPC};
      case Outcome::kShort:
        full_next_ = true;
        return {0, 1};
      case Outcome::kGood:
        break;
    }
    if (is_write) {
      written_.insert(call.path.string());
    } else if (call.operation == core::FileOperation::kSyncAll) {
      synced_.merge(written_);
      written_.clear();
      renamed_.clear();
    } else if (call.operation == core::FileOperation::kSync) {
      synced_.insert(call.path.string());
      std::erase_if(renamed_, [&](const auto& entry) {
        return std::filesystem::path(entry.first).parent_path() == call.path;
      });
    } else if (call.operation == core::FileOperation::kRename) {
      const std::string from = call.path.string();
      const auto earlier = renamed_.find(from);
      const bool is_new = written_.contains(from) || synced_.contains(from);
      Move move{from, is_new && !synced_.contains(from), !is_new};
      if (earlier != renamed_.end()) {
        move = earlier->second;
        renamed_.erase(earlier);
      }
      renamed_[call.to.string()] = move;
    } else if (call.operation == core::FileOperation::kRemove) {
      renamed_.erase(call.path.string());
    }
    return {};
  }

  static File* file_of(sqlite3_file* file) { return reinterpret_cast<File*>(file); }
  static sqlite3_file* real_of(sqlite3_file* file) { return file_of(file)->real; }

  static int open(sqlite3_vfs* /*vfs*/, const char* name, sqlite3_file* file, int flags,
                  int* flags_out) {
    FaultyDisk& disk = *the_disk();
    File* const self = file_of(file);
    self->base.pMethods = nullptr;
    self->real = reinterpret_cast<sqlite3_file*>(self + 1);
    const int result = disk.real_->xOpen(disk.real_, name, self->real, flags, flags_out);
    if (result != SQLITE_OK) {
      return result;
    }
    self->path = new std::string(name == nullptr ? "" : name);  // deleted by close
    // Version 1: no shared memory, which one exclusive connection does without.
    static const sqlite3_io_methods methods = {
        1,       &close,  &read_at,    &write_at,     &truncate,    &sync,      &file_size,
        &lock,   &unlock, &check_lock, &file_control, &sector_size, &abilities, nullptr,
        nullptr, nullptr, nullptr,     nullptr,       nullptr};
    self->base.pMethods = &methods;
    return SQLITE_OK;
  }
  static int close(sqlite3_file* file) {
    delete file_of(file)->path;
    return real_of(file)->pMethods->xClose(real_of(file));
  }
  static int read_at(sqlite3_file* file, void* data, int size, sqlite3_int64 offset) {
    return real_of(file)->pMethods->xRead(real_of(file), data, size, offset);
  }
  static int write_at(sqlite3_file* file, const void* data, int size, sqlite3_int64 offset) {
    FaultyDisk& disk = *the_disk();
    const std::lock_guard lock(disk.mutex_);
    const Outcome outcome = disk.next(true);
    if (outcome == Outcome::kFails) {
      return SQLITE_IOERR_WRITE;
    }
    if (outcome == Outcome::kFull) {
      return SQLITE_FULL;
    }
    const int written = outcome == Outcome::kShort ? size / 2 : size;
    Write write;
    write.offset = static_cast<std::size_t>(offset);
    sqlite3_int64 size_before = 0;
    real_of(file)->pMethods->xFileSize(real_of(file), &size_before);
    write.size_before = static_cast<std::size_t>(size_before);
    if (offset < size_before) {
      write.before.resize(
          static_cast<std::size_t>(std::min<sqlite3_int64>(written, size_before - offset)));
      real_of(file)->pMethods->xRead(real_of(file), write.before.data(),
                                     static_cast<int>(write.before.size()), offset);
    }
    write.after.assign(static_cast<const char*>(data), static_cast<std::size_t>(written));
    disk.unsynced_[*file_of(file)->path].push_back(std::move(write));
    const int result = real_of(file)->pMethods->xWrite(real_of(file), data, written, offset);
    return outcome == Outcome::kShort ? SQLITE_FULL : result;
  }
  static int truncate(sqlite3_file* file, sqlite3_int64 size) {
    FaultyDisk& disk = *the_disk();
    const std::lock_guard lock(disk.mutex_);
    if (disk.next(false) != Outcome::kGood) {
      return SQLITE_IOERR_TRUNCATE;
    }
    Write write;
    write.offset = static_cast<std::size_t>(size);
    write.is_truncation = true;
    sqlite3_int64 size_before = 0;
    real_of(file)->pMethods->xFileSize(real_of(file), &size_before);
    write.size_before = static_cast<std::size_t>(size_before);
    if (size < size_before) {
      write.before.resize(static_cast<std::size_t>(size_before - size));
      real_of(file)->pMethods->xRead(real_of(file), write.before.data(),
                                     static_cast<int>(write.before.size()), size);
    }
    disk.unsynced_[*file_of(file)->path].push_back(std::move(write));
    return real_of(file)->pMethods->xTruncate(real_of(file), size);
  }
  static int sync(sqlite3_file* file, int flags) {
    FaultyDisk& disk = *the_disk();
    const std::lock_guard lock(disk.mutex_);
    if (disk.next(false) != Outcome::kGood) {
      return SQLITE_IOERR_FSYNC;
    }
    disk.unsynced_.erase(*file_of(file)->path);
    return real_of(file)->pMethods->xSync(real_of(file), flags);
  }
  static int remove(sqlite3_vfs* /*vfs*/, const char* name, int sync_folder) {
    FaultyDisk& disk = *the_disk();
    const std::lock_guard lock(disk.mutex_);
    if (disk.next(false) != Outcome::kGood) {
      return SQLITE_IOERR_DELETE;
    }
    disk.unsynced_.erase(name);
    return disk.real_->xDelete(disk.real_, name, sync_folder);
  }
  static int file_size(sqlite3_file* file, sqlite3_int64* size) {
    return real_of(file)->pMethods->xFileSize(real_of(file), size);
  }
  static int lock(sqlite3_file* file, int level) {
    return real_of(file)->pMethods->xLock(real_of(file), level);
  }
  static int unlock(sqlite3_file* file, int level) {
    return real_of(file)->pMethods->xUnlock(real_of(file), level);
  }
  static int check_lock(sqlite3_file* file, int* result) {
    return real_of(file)->pMethods->xCheckReservedLock(real_of(file), result);
  }
  static int file_control(sqlite3_file* file, int operation, void* argument) {
    return real_of(file)->pMethods->xFileControl(real_of(file), operation, argument);
  }
  static int sector_size(sqlite3_file* file) {
    return real_of(file)->pMethods->xSectorSize(real_of(file));
  }
  static int abilities(sqlite3_file* file) {
    return real_of(file)->pMethods->xDeviceCharacteristics(real_of(file));
  }

  sqlite3_vfs* real_ = nullptr;
  sqlite3_vfs vfs_{};
  core::FileFaultHook hook_;

  std::mutex mutex_;  // of everything below
  std::uint64_t count_ = 0;
  std::uint64_t nth_ = 0;
  Fault fault_ = Fault::kIoError;
  bool has_struck_ = false;
  bool full_next_ = false;                              // after a short write
  std::map<std::string, std::vector<Write>> unsynced_;  // of SQLite's files
  std::map<std::string, Move> renamed_;                 // since their folders were synced
  std::set<std::string> synced_;
  std::set<std::string> written_;  // and perhaps not synced
};

}  // namespace weft::coordinator
