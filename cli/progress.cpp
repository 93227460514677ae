#include "cli/progress.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <unistd.h>

namespace weft::cli {

namespace {

constexpr double kTerminalPeriodSeconds = 0.2;
constexpr double kPlainPeriodSeconds = 5;
constexpr std::size_t kBarWidth = 24;

bool is_finished(const StageProgress& stage) {
  return stage.total > 0 && stage.done >= stage.total;
}

bool is_running(const StageProgress& stage) { return stage.total > 0 && !is_finished(stage); }

// Shards computed per second; 0 when nothing has been computed yet.
double rate_per_second(const StageProgress& stage) {
  if (stage.shards_per_second) {
    return *stage.shards_per_second;
  }
  const double computed = static_cast<double>(stage.done - std::min(stage.cached, stage.done));
  return stage.seconds > 0 ? computed / stage.seconds : 0;
}

std::string format_rate(double per_second) {
  if (per_second >= 1) {
    return fmt::format("{:.1f}/s", per_second);
  }
  return fmt::format("{:.1f}/min", per_second * 60);
}

std::string rate_and_time_left(const StageProgress& stage) {
  const double left = seconds_left(stage);
  if (left < 0) {
    return "";
  }
  return fmt::format("{}, {} left", format_rate(rate_per_second(stage)), format_duration(left));
}

std::string finished_text(const StageProgress& stage) {
  std::string text = fmt::format("{} done in {}", stage.total, format_duration(stage.seconds));
  if (stage.cached > 0) {
    text += fmt::format(", {} of them from the cache", stage.cached);
  }
  return text;
}

}  // namespace

std::string format_duration(double seconds) {
  if (!(seconds >= 0)) {
    return "?";
  }
  if (seconds < 9.95) {
    return fmt::format("{:.1f} s", seconds);
  }
  const auto whole = static_cast<std::uint64_t>(std::llround(std::fmin(seconds, 1e12)));
  if (whole < 60) {
    return fmt::format("{} s", whole);
  }
  if (whole < 3600) {
    return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  }
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

std::string format_bytes(std::uint64_t bytes) {
  constexpr std::array<const char*, 6> kUnits{"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (value >= 1024 && unit + 1 < kUnits.size()) {
    value /= 1024;
    ++unit;
  }
  if (unit == 0 || value >= 9.95) {
    return fmt::format("{:.0f} {}", value, kUnits[unit]);
  }
  return fmt::format("{:.1f} {}", value, kUnits[unit]);
}

double seconds_left(const StageProgress& stage) {
  const double rate = rate_per_second(stage);
  if (rate <= 0 || stage.total == 0) {
    return -1;
  }
  return static_cast<double>(stage.total - std::min(stage.done, stage.total)) / rate;
}

std::string stage_line(const StageProgress& stage) {
  if (stage.total == 0) {
    return fmt::format("{:<14} waiting", stage.name);
  }
  if (is_finished(stage)) {
    return fmt::format("{:<14} {}", stage.name, finished_text(stage));
  }
  const double share = static_cast<double>(stage.done) / static_cast<double>(stage.total);
  const auto filled = static_cast<std::size_t>(share * static_cast<double>(kBarWidth));
  const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
  std::string line = fmt::format("{:<14} [{}] {}/{} {:.0f} %", stage.name, bar, stage.done,
                                 stage.total, std::floor(share * 100));
  const std::string rate = rate_and_time_left(stage);
  return rate.empty() ? line : line + "  " + rate;
}

std::string plain_line(const std::vector<StageProgress>& stages) {
  std::string line;
  for (const StageProgress& stage : stages) {
    if (!is_running(stage)) {
      continue;
    }
    line += line.empty() ? "" : "; ";
    line += fmt::format("{} {}/{}", stage.name, stage.done, stage.total);
    const std::string rate = rate_and_time_left(stage);
    if (!rate.empty()) {
      line += fmt::format(" ({})", rate);
    }
  }
  return line;
}

ProgressPrinter::ProgressPrinter(std::FILE* out) : ProgressPrinter(out, isatty(fileno(out)) == 1) {}

ProgressPrinter::ProgressPrinter(std::FILE* out, bool is_terminal)
    : out_(out), is_terminal_(is_terminal) {}

void ProgressPrinter::update(const std::vector<StageProgress>& stages) {
  const double now_seconds = since_start_.seconds();
  if (is_terminal_) {
    if (now_seconds - shown_at_seconds_ >= kTerminalPeriodSeconds) {
      redraw(stages);
      shown_at_seconds_ = now_seconds;
    }
    return;
  }
  for (const StageProgress& stage : stages) {
    if (is_finished(stage) &&
        std::find(finished_.begin(), finished_.end(), stage.name) == finished_.end()) {
      finished_.push_back(stage.name);
      fmt::print(out_, "{}: {}\n", stage.name, finished_text(stage));
    }
  }
  if (now_seconds - shown_at_seconds_ >= kPlainPeriodSeconds) {
    const std::string line = plain_line(stages);
    if (!line.empty()) {
      fmt::print(out_, "{}\n", line);
      shown_at_seconds_ = now_seconds;
    }
  }
  std::fflush(out_);
}

void ProgressPrinter::note(const std::string& text) {
  if (is_terminal_ && lines_shown_ > 0) {
    fmt::print(out_, "\x1b[{}A\x1b[J", lines_shown_);
    lines_shown_ = 0;
    shown_at_seconds_ = -1e9;
  }
  fmt::print(out_, "{}\n", text);
  std::fflush(out_);
}

void ProgressPrinter::finish(const std::vector<StageProgress>& stages) {
  if (is_terminal_) {
    redraw(stages);
  } else {
    update(stages);
  }
}

void ProgressPrinter::redraw(const std::vector<StageProgress>& stages) {
  if (lines_shown_ > 0) {
    fmt::print(out_, "\x1b[{}A", lines_shown_);
  }
  for (const StageProgress& stage : stages) {
    fmt::print(out_, "\r\x1b[K{}\n", stage_line(stage));
  }
  lines_shown_ = stages.size();
  std::fflush(out_);
}

}  // namespace weft::cli
