#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include "cli/interruption.h"

namespace weft::cli {

// While one lives, a process that was asked to end (Ctrl-C, SIGTERM) ends within a few seconds,
// though a coordinator or a disk keeps it waiting: with the words on stderr and exit code 1, and
// without leaving anything behind tidily. For work that writes beside and renames, and therefore
// loses nothing by it.
class EndInTime {
 public:
  EndInTime(const Interruption& interruption, double grace_seconds, std::string words);
  ~EndInTime();
  EndInTime(const EndInTime&) = delete;
  EndInTime& operator=(const EndInTime&) = delete;
  EndInTime(EndInTime&&) = delete;
  EndInTime& operator=(EndInTime&&) = delete;

 private:
  void watch(const Interruption& interruption, double grace_seconds);

  std::string words_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_over_ = false;
  std::thread watcher_;
};

}  // namespace weft::cli
