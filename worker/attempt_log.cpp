#include "worker/attempt_log.h"

#include <algorithm>
#include <chrono>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "proto/limits.h"

namespace weft::worker {

namespace {

constexpr std::chrono::seconds kSometimes{1};
constexpr std::size_t kLineLimitBytes = 5000;
constexpr std::size_t kPendingLimitBytes = std::size_t{96} << 10;
constexpr std::size_t kImportantLimitBytes = std::size_t{128} << 10;

std::string written(core::Clock::Time time) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(time);
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(seconds)),
                     (time - seconds).count());
}

// How many bytes the UTF-8 character at the beginning has; 0 when there is none.
std::size_t character_bytes(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  const std::size_t size = first < 0x80    ? 1
                           : first < 0xc2  ? 0
                           : first < 0xe0  ? 2
                           : first < 0xf0  ? 3
                           : first <= 0xf4 ? 4
                                           : 0;
  if (size == 0 || size > text.size()) {
    return 0;
  }
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0U) != 0x80) {
      return 0;
    }
  }
  // Overlong forms, surrogates and what is beyond U+10FFFF.
  const bool is_wrong = (first == 0xe0 && byte(1) < 0xa0) || (first == 0xed && byte(1) >= 0xa0) ||
                        (first == 0xf0 && byte(1) < 0x90) || (first == 0xf4 && byte(1) >= 0x90);
  return is_wrong ? 0 : size;
}

}  // namespace

std::string printable(std::string_view text) {
  constexpr unsigned char kFirstPrintable = 0x20;
  constexpr unsigned char kDelete = 0x7f;
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const auto first = static_cast<unsigned char>(text[0]);
    const std::size_t size = character_bytes(text);
    if (first < kFirstPrintable || first == kDelete) {
      result.push_back(' ');
    } else if (size == 0) {
      result.push_back('?');
    } else {
      result += text.substr(0, size);
    }
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return result;
}

std::string_view beginning_of(std::string_view text, std::size_t limit) {
  if (text.size() <= limit) {
    return text;
  }
  constexpr unsigned char kContinues = 0x80;
  constexpr unsigned char kMask = 0xc0;
  while (limit > 0 && (static_cast<unsigned char>(text[limit]) & kMask) == kContinues) {
    --limit;
  }
  return text.substr(0, limit);
}

void AttemptLog::add(std::string_view text) { add_line(text, kPendingLimitBytes); }

void AttemptLog::add_sometimes(std::string_view text) {
  const core::Clock::Time now = clock_.now();
  {
    const std::lock_guard lock(mutex_);
    if (now >= sometimes_at_ && now - sometimes_at_ < kSometimes) {
      last_line_ = beginning_of(printable(text), v1::kLastLineLimitBytes);
      return;
    }
    sometimes_at_ = now;
  }
  add(text);
}

void AttemptLog::add_important(std::string_view text) { add_line(text, kImportantLimitBytes); }

void AttemptLog::add_line(std::string_view text, std::size_t limit_bytes) {
  const std::string line = printable(beginning_of(text, kLineLimitBytes));
  const std::string time = written(clock_.now());
  const std::lock_guard lock(mutex_);
  last_line_ = beginning_of(line, v1::kLastLineLimitBytes);
  if (pending_.size() + line.size() + 2 * time.size() > limit_bytes) {
    ++dropped_;
    return;
  }
  if (dropped_ > 0) {
    pending_ +=
        fmt::format("{} [{} lines were dropped here: the coordinator was away]\n", time, dropped_);
    dropped_ = 0;
  }
  pending_ += time + " " + line + "\n";
}

std::string AttemptLog::last_line() const {
  const std::lock_guard lock(mutex_);
  return last_line_;
}

AttemptLog::Piece AttemptLog::next_piece() const {
  const std::lock_guard lock(mutex_);
  return {offset_, std::string(beginning_of(pending_, v1::kLogChunkLimitBytes))};
}

bool AttemptLog::has_more() const {
  const std::lock_guard lock(mutex_);
  return !pending_.empty();
}

void AttemptLog::arrived(std::uint64_t size_bytes) {
  const std::lock_guard lock(mutex_);
  if (size_bytes > offset_ && size_bytes - offset_ <= pending_.size()) {
    pending_.erase(0, size_bytes - offset_);
  }
  offset_ = size_bytes;
}

}  // namespace weft::worker
