#include "coordinator/scheduler/log_store.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "coordinator/scheduler/messages.h"
#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"

namespace weft::coordinator {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "weft-log 1 ";
constexpr std::string_view kExtension = ".log";
constexpr std::size_t kHeaderLimitBytes = 128;

std::string header_of(std::uint64_t head, std::uint64_t dropped) {
  return fmt::format("{}{} {}\n", kMagic, head, dropped);
}

[[noreturn]] void throw_write_error(const fs::path& path) {
  const int cause = errno;
  const bool is_full = cause == ENOSPC || cause == EDQUOT || cause == EFBIG;
  throw core::Error(is_full ? core::Code::kResourceExhausted : core::Code::kUnavailable,
                    "cannot write the log " + path.filename().string() + ": " +
                        std::generic_category().message(cause));
}

// The attempt whose log has this file name.
std::optional<std::uint64_t> attempt_named(const std::string& name) {
  std::uint64_t attempt = 0;
  const char* const end = name.data() + name.size() - std::min(name.size(), kExtension.size());
  const auto [last, failure] = std::from_chars(name.data(), end, attempt);
  const bool is_log =
      name.ends_with(kExtension) && failure == std::errc() && last == end && end != name.data();
  return is_log ? std::optional(attempt) : std::nullopt;
}

// Where the line ends that holds the byte in front of `at`; `at` itself when it is a line's
// beginning. The text's end when the line has none.
std::size_t next_line(std::string_view text, std::size_t at) {
  if (at == 0 || text[at - 1] == '\n') {
    return at;
  }
  const std::size_t end = text.find('\n', at);
  return end == std::string_view::npos ? text.size() : end + 1;
}

std::size_t line_before(std::string_view text, std::size_t at) {
  const std::size_t end = text.rfind('\n', at == 0 ? 0 : at - 1);
  return end == std::string_view::npos ? at : end + 1;
}

}  // namespace

LogStore::LogStore(fs::path folder, LogLimits limits)
    : folder_(std::move(folder)), limits_(limits) {
  core::make_folder(folder_);
  load();
}

// Names and sizes only: headers are read when they are needed.
void LogStore::load() {
  std::vector<std::pair<fs::file_time_type, std::string>> order;
  std::error_code failure;
  for (const auto& folder : fs::directory_iterator(folder_, failure)) {
    const std::string name = folder.path().filename().string();
    std::error_code gone;
    Job job;
    for (const auto& item : fs::directory_iterator(folder.path(), gone)) {
      std::error_code vanished;
      const auto attempt = attempt_named(item.path().filename().string());
      const std::uint64_t bytes = attempt ? item.file_size(vanished) : 0;
      if (!attempt || vanished) {
        fs::remove(item.path(), vanished);  // half of a log that was being cut
        continue;
      }
      job.logs[*attempt].file_bytes = bytes;
      job.bytes += counted(bytes);
    }
    if (!job.logs.empty()) {
      order.emplace_back(folder.last_write_time(gone), name);
      total_bytes_ += job.bytes;
      jobs_[name] = std::move(job);
    }
  }
  std::sort(order.begin(), order.end());
  for (const auto& [time, name] : order) {
    jobs_[name].written = ++writes_;
  }
}

fs::path LogStore::path_of(const std::string& job, std::uint64_t attempt) const {
  return folder_ / job / fmt::format("{}{}", attempt, kExtension);
}

std::uint64_t LogStore::counted(std::uint64_t file_bytes) const {
  return (file_bytes + limits_.block_bytes - 1) / limits_.block_bytes * limits_.block_bytes;
}

// Reads the header. A file that has none begins again.
void LogStore::know(const std::string& job, std::uint64_t attempt, Log& log) const {
  if (log.is_known) {
    return;
  }
  log.is_known = true;
  std::ifstream in(path_of(job, attempt), std::ios::binary);
  std::string start(kHeaderLimitBytes, '\0');
  in.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  const std::size_t end = start.find('\n');
  const char* const stop = start.data() + (end == std::string::npos ? 0 : end);
  Log found = log;
  const char* at = start.data() + kMagic.size();
  if (end != std::string::npos && start.starts_with(kMagic)) {
    const auto head = std::from_chars(at, stop, found.head);
    const auto dropped = std::from_chars(std::min(head.ptr + 1, stop), stop, found.dropped);
    found.header_bytes = end + 1;
    const bool is_good = head.ec == std::errc() && dropped.ec == std::errc() &&
                         dropped.ptr == stop && found.header_bytes <= found.file_bytes &&
                         found.head <= found.file_bytes - found.header_bytes;
    if (is_good) {
      log = found;
      return;
    }
  }
  log.file_bytes = 0;
}

const LogStore::Log* LogStore::find(const std::string& job, std::uint64_t attempt) const {
  const auto found = jobs_.find(job);
  if (found == jobs_.end()) {
    return nullptr;
  }
  const auto log = found->second.logs.find(attempt);
  if (log == found->second.logs.end()) {
    return nullptr;
  }
  know(job, attempt, log->second);
  return &log->second;
}

std::optional<std::uint64_t> LogStore::append(const std::string& job, std::uint64_t attempt,
                                              std::uint64_t offset, std::string_view text) {
  check_id(job, "job_id");
  const std::lock_guard lock(mutex_);
  const Log* const known = find(job, attempt);
  const std::uint64_t size = known == nullptr ? 0 : known->size();
  if (offset > size) {
    return std::nullopt;
  }
  if (size - offset >= text.size()) {
    return size;
  }
  text.remove_prefix(size - offset);
  Job& entry = jobs_[job];
  Log& log = entry.logs[attempt];
  log.is_known = true;
  const std::uint64_t before = counted(log.file_bytes);
  const fs::path path = path_of(job, attempt);
  std::error_code failure;
  fs::create_directories(path.parent_path(), failure);
  try {
    add_text(path, log, text);
    if (log.file_bytes - log.header_bytes > limits_.attempt_bytes) {
      drop_middle(path, log);
    }
  } catch (const core::Error&) {
    // What is on the disk now is found again when it is needed.
    std::error_code gone;
    const std::uint64_t bytes = fs::file_size(path, gone);
    log = Log();
    log.file_bytes = gone ? 0 : bytes;
    total_bytes_ += counted(log.file_bytes) - before;
    entry.bytes += counted(log.file_bytes) - before;
    throw;
  }
  total_bytes_ += counted(log.file_bytes) - before;
  entry.bytes += counted(log.file_bytes) - before;
  entry.written = ++writes_;
  ++entry.revision;
  const std::uint64_t now = log.size();
  make_room(job);
  changed_.notify_all();
  return now;
}

void LogStore::add_text(const fs::path& path, Log& log, std::string_view text) const {
  const bool is_new = log.file_bytes == 0;
  errno = 0;
  std::ofstream out(path, std::ios::binary | (is_new ? std::ios::trunc : std::ios::app));
  if (is_new) {
    const std::string header = header_of(0, 0);
    out << header;
    log.header_bytes = header.size();
    log.file_bytes = header.size();
  }
  out << text << std::flush;
  if (!out) {
    throw_write_error(path);
  }
  log.file_bytes += text.size();
}

// Keeps the first half of the limit and the last quarter, so that this is not soon done again.
void LogStore::drop_middle(const fs::path& path, Log& log) const {
  const std::string file = core::read_file(path);
  const std::string_view text = std::string_view(file).substr(log.header_bytes);
  const std::size_t head =
      log.dropped > 0 ? static_cast<std::size_t>(log.head)
                      : line_before(text, static_cast<std::size_t>(limits_.attempt_bytes / 2));
  const std::size_t tail = std::max(
      head, next_line(text, text.size() - static_cast<std::size_t>(limits_.attempt_bytes / 4)));
  const std::uint64_t dropped = log.dropped + (tail - head);
  const std::string header = header_of(head, dropped);
  const fs::path beside = path.string() + ".part";
  errno = 0;
  {
    std::ofstream out(beside, std::ios::binary | std::ios::trunc);
    out << header << text.substr(0, head) << text.substr(tail) << std::flush;
    if (!out) {
      throw_write_error(path);
    }
  }
  std::error_code failure;
  fs::rename(beside, path, failure);
  if (failure) {
    throw core::Error(core::Code::kUnavailable, "cannot write a log: " + failure.message());
  }
  log.head = head;
  log.dropped = dropped;
  log.header_bytes = header.size();
  log.file_bytes = header.size() + head + (text.size() - tail);
}

// Removes the oldest logs of `job` beyond its limit, then those of the jobs that wrote least
// recently beyond the limit of all. The log that was written last stays.
void LogStore::make_room(const std::string& job) {
  const auto own = jobs_.find(job);
  while (own->second.bytes > limits_.job_bytes && own->second.logs.size() > 1) {
    forget(own, own->second.logs.begin()->first);
  }
  while (total_bytes_ > limits_.total_bytes) {
    const auto oldest = std::min_element(
        jobs_.begin(), jobs_.end(),
        [](const auto& a, const auto& b) { return a.second.written < b.second.written; });
    if (oldest == own && own->second.logs.size() == 1) {
      return;
    }
    while (!oldest->second.logs.empty() && (oldest != own || oldest->second.logs.size() > 1) &&
           total_bytes_ > limits_.total_bytes) {
      forget(oldest, oldest->second.logs.begin()->first);
    }
    if (oldest->second.logs.empty()) {
      spdlog::info("job={} event=logs_removed", oldest->first);
      std::error_code gone;
      fs::remove_all(folder_ / oldest->first, gone);
      jobs_.erase(oldest);
    }
  }
}

void LogStore::forget(std::map<std::string, Job>::iterator job, std::uint64_t attempt) {
  const auto log = job->second.logs.find(attempt);
  const std::uint64_t bytes = counted(log->second.file_bytes);
  std::error_code gone;
  fs::remove(path_of(job->first, attempt), gone);
  job->second.bytes -= bytes;
  total_bytes_ -= bytes;
  job->second.logs.erase(log);
}

std::vector<std::uint64_t> LogStore::attempts(const std::string& job) const {
  const std::lock_guard lock(mutex_);
  std::vector<std::uint64_t> attempts;
  const auto found = jobs_.find(job);
  if (found != jobs_.end()) {
    for (const auto& [attempt, log] : found->second.logs) {
      attempts.push_back(attempt);
    }
  }
  return attempts;
}

std::uint64_t LogStore::size(const std::string& job, std::uint64_t attempt) const {
  const std::lock_guard lock(mutex_);
  const Log* const log = find(job, attempt);
  return log == nullptr ? 0 : log->size();
}

LogStore::Part LogStore::read(const std::string& job, std::uint64_t attempt, std::uint64_t offset,
                              std::size_t limit_bytes) const {
  const std::lock_guard lock(mutex_);
  const Log* const log = find(job, attempt);
  if (log == nullptr || offset >= log->size()) {
    return {"", log == nullptr ? offset : log->size()};
  }
  const std::uint64_t gap_end = log->head + log->dropped;
  if (log->dropped > 0 && offset >= log->head && offset < gap_end) {
    return {fmt::format("[... {} bytes were dropped here ...]\n", gap_end - offset), gap_end};
  }
  const bool is_behind = log->dropped > 0 && offset >= gap_end;
  const std::uint64_t at = log->header_bytes + offset - (is_behind ? log->dropped : 0);
  const std::uint64_t end =
      log->dropped > 0 && !is_behind ? log->header_bytes + log->head : log->file_bytes;
  std::string text(std::min<std::uint64_t>(limit_bytes, end - at), '\0');
  std::ifstream in(path_of(job, attempt), std::ios::binary);
  in.seekg(static_cast<std::streamoff>(at));
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  if (text.empty()) {  // the file was removed behind our back
    return {"", log->size()};
  }
  const std::uint64_t next = offset + text.size();
  return {std::move(text), next};
}

std::uint64_t LogStore::revision(const std::string& job) const {
  const std::lock_guard lock(mutex_);
  const auto found = jobs_.find(job);
  return found == jobs_.end() ? 0 : found->second.revision;
}

void LogStore::wait_for_change(const std::string& job, std::uint64_t seen,
                               std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] {
    const auto found = jobs_.find(job);
    return (found == jobs_.end() ? 0 : found->second.revision) != seen;
  });
}

}  // namespace weft::coordinator
