#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/web/disk_use.h"

namespace weft::coordinator {

// The coordinator in figures for Prometheus; docs/status_page.md lists them. Any thread.
class Metrics {
 public:
  Metrics();
  ~Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;
  Metrics(Metrics&&) = delete;
  Metrics& operator=(Metrics&&) = delete;

  // For the scheduler's options; this must outlive that scheduler.
  [[nodiscard]] SchedulerHooks hooks();

  void request_answered(int status, double seconds);
  void swatch_drawn(bool is_thumbnail, double seconds);

  // What cannot be counted as it happens.
  struct Now {
    Census census;
    std::uint64_t journal_bytes = 0;
    std::optional<DiskUse::Bytes> disk;
    std::uint64_t disk_free_bytes = 0;
    int streams = 0;
    bool has_problem = false;  // the coordinator must end
  };
  // All of it in Prometheus' text format.
  [[nodiscard]] std::string text(const Now& now);

 private:
  struct Families;
  std::unique_ptr<Families> families_;
};

}  // namespace weft::coordinator
