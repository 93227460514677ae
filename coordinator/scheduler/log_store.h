#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/limits.h"

namespace weft::coordinator {

struct LogLimits {
  std::uint64_t attempt_bytes = v1::kAttemptLogLimitBytes;
  // A file counts as one block of the disk at least, so that these bound the number of files too.
  std::uint64_t job_bytes = std::uint64_t{64} << 20;
  std::uint64_t total_bytes = std::uint64_t{1} << 30;
  std::uint64_t block_bytes = 4096;
};

// What attempts logged, one text file each: folder/JOB/ATTEMPT.log. A log that grows beyond its
// limit loses lines from its middle, a job beyond its limit its oldest attempts' logs, all together
// the logs of the jobs that wrote least recently. Nothing is synced: a crash of the machine may
// cost the end of a log. What an earlier process wrote is found again. Any thread.
//
// Offsets are in all that was logged, what was dropped included.
class LogStore {
 public:
  // Throws core::Error(kUnavailable) when the folder cannot be made.
  explicit LogStore(std::filesystem::path folder, LogLimits limits = {});

  // Adds `text` from `offset` on, less what is there already, and returns how much there is now;
  // nothing when the offset is beyond the end. Throws core::Error(kInvalidArgument) on a job's name
  // that is none, kResourceExhausted when the disk is full, kUnavailable when it fails otherwise.
  std::optional<std::uint64_t> append(const std::string& job, std::uint64_t attempt,
                                      std::uint64_t offset, std::string_view text);

  // The attempts of the job that have a log, rising.
  [[nodiscard]] std::vector<std::uint64_t> attempts(const std::string& job) const;
  // How much was logged; 0: nothing.
  [[nodiscard]] std::uint64_t size(const std::string& job, std::uint64_t attempt) const;

  // What follows `offset`, `limit_bytes` at most, and where that ends. Where lines were dropped
  // there is one that says so. Empty at the end, and when there is no such log.
  struct Part {
    std::string text;
    std::uint64_t next = 0;
  };
  [[nodiscard]] Part read(const std::string& job, std::uint64_t attempt, std::uint64_t offset,
                          std::size_t limit_bytes) const;

  // Rises with every change of a log of the job.
  [[nodiscard]] std::uint64_t revision(const std::string& job) const;
  // Until it is another than `seen`, or the time is over.
  void wait_for_change(const std::string& job, std::uint64_t seen,
                       std::chrono::milliseconds timeout) const;

 private:
  struct Log {
    bool is_known = false;           // the rest was read from the file
    std::uint64_t file_bytes = 0;    // 0: there is no file yet
    std::uint64_t header_bytes = 0;  // in front of the text
    std::uint64_t head = 0;          // where lines were dropped
    std::uint64_t dropped = 0;       // how much

    [[nodiscard]] std::uint64_t size() const { return file_bytes - header_bytes + dropped; }
  };
  struct Job {
    std::map<std::uint64_t, Log> logs;
    std::uint64_t bytes = 0;  // as counted
    std::uint64_t revision = 0;
    std::uint64_t written = 0;  // rises from the job that wrote least recently
  };

  void load();
  // REQUIRES of all of these: mutex_ is held.
  void know(const std::string& job, std::uint64_t attempt, Log& log) const;
  void add_text(const std::filesystem::path& path, Log& log, std::string_view text) const;
  void drop_middle(const std::filesystem::path& path, Log& log) const;
  void make_room(const std::string& job);
  void forget(std::map<std::string, Job>::iterator job, std::uint64_t attempt);
  [[nodiscard]] std::uint64_t counted(std::uint64_t file_bytes) const;
  [[nodiscard]] std::filesystem::path path_of(const std::string& job, std::uint64_t attempt) const;
  [[nodiscard]] const Log* find(const std::string& job, std::uint64_t attempt) const;

  const std::filesystem::path folder_;
  const LogLimits limits_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  mutable std::map<std::string, Job> jobs_;
  std::uint64_t total_bytes_ = 0;
  std::uint64_t writes_ = 0;
};

}  // namespace weft::coordinator
