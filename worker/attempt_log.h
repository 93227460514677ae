#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <string_view>

#include "core/clock.h"

namespace weft::worker {

// What an attempt logs, for the coordinator to keep (WorkerService.AppendLog). Holds what the
// coordinator does not have yet, within a limit: while it is away further lines are counted instead
// of kept, but for important ones, for which some room is left. Any thread.
class AttemptLog {
 public:
  // `clock` must outlive the log.
  explicit AttemptLog(const core::Clock& clock = core::system_clock()) : clock_(clock) {}

  // Adds "TIME text" as one line; longer than 5000 bytes it is cut.
  void add(std::string_view text);
  // The same, but at most one line a second: what comes in between is only the last line.
  void add_sometimes(std::string_view text);
  // The same for warnings and errors.
  void add_important(std::string_view text);

  // The last line without its time, at most kLastLineLimitBytes; empty before the first.
  [[nodiscard]] std::string last_line() const;

  // The text that follows the `offset` bytes which the coordinator has, at most
  // kLogChunkLimitBytes; empty when it has all.
  struct Piece {
    std::uint64_t offset = 0;
    std::string text;
  };
  [[nodiscard]] Piece next_piece() const;
  [[nodiscard]] bool has_more() const;

  // The coordinator has `size_bytes` of the log. When that is less than it had already, or more
  // than there was (it crashed and lost the end, or this log is another process's heir), goes on
  // from there.
  void arrived(std::uint64_t size_bytes);

 private:
  void add_line(std::string_view text, std::size_t limit_bytes);

  const core::Clock& clock_;
  mutable std::mutex mutex_;
  std::string pending_;        // whole lines
  std::uint64_t offset_ = 0;   // of pending_ in all that was logged
  std::uint64_t dropped_ = 0;  // lines since the last kept one
  std::string last_line_;
  core::Clock::Time sometimes_at_{};
};

// The text as valid UTF-8 without control characters: what is not becomes ' ' or '?'.
[[nodiscard]] std::string printable(std::string_view text);

// The first `limit` bytes of UTF-8 text, without half a character at the end.
[[nodiscard]] std::string_view beginning_of(std::string_view text, std::size_t limit);

}  // namespace weft::worker
