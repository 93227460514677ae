#pragma once

#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "core/clock.h"

namespace weft::cli {

// How far one stage of a job is. `total` is 0 until the stage is planned.
struct StageProgress {
  std::string name;
  std::uint64_t done = 0;                     // shards finished, those found in the cache included
  std::uint64_t total = 0;                    // shards in all
  std::uint64_t cached = 0;                   // of `done`: taken from the cache, not computed
  double seconds = 0;                         // since the stage began; stops when it is finished
  double cpu_seconds = 0;                     // of a run in this process: what it cost all threads
  std::optional<double> shards_per_second{};  // where it was measured; else done over seconds
};

// "0.4 s", "12 s", "3 min 20 s", "2 h 05 min".
[[nodiscard]] std::string format_duration(double seconds);

// "512 B", "1.5 KiB", "20 MiB".
[[nodiscard]] std::string format_bytes(std::uint64_t bytes);

// Seconds the stage still needs at its rate so far; negative when there is no rate to go by.
[[nodiscard]] double seconds_left(const StageProgress& stage);

// One line about a stage for a terminal: a bar, shards done, rate, time left.
// "transfer       [########........]  512/1024  50 %  12.5/s  41 s left"
[[nodiscard]] std::string stage_line(const StageProgress& stage);

// One plain line about all stages that are under way:
// "visibility 512/1024 (12.5/s, 41 s left), transfer 0/70".
[[nodiscard]] std::string plain_line(const std::vector<StageProgress>& stages);

// Shows progress on stderr: on a terminal a block of lines redrawn in place, elsewhere a plain line
// every few seconds and whenever a stage is finished. One thread at a time.
class ProgressPrinter {
 public:
  explicit ProgressPrinter(std::FILE* out);
  ProgressPrinter(std::FILE* out, bool is_terminal);

  // Shows `stages` if it is time to, and always when the set of finished stages has changed.
  void update(const std::vector<StageProgress>& stages);
  // Prints a line of its own above the progress.
  void note(const std::string& text);
  // Shows the last state and leaves it standing.
  void finish(const std::vector<StageProgress>& stages);

 private:
  void redraw(const std::vector<StageProgress>& stages);

  std::FILE* out_;
  bool is_terminal_;
  core::Stopwatch since_start_;
  double shown_at_seconds_ = -1e9;
  std::size_t lines_shown_ = 0;
  std::vector<std::string> finished_;
};

}  // namespace weft::cli
