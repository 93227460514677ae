#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "coordinator/scheduler/scheduler.h"

namespace weft::coordinator {

// What the page shows live, each as JSON: {"unfinished": how many, "list": ListJobsResponse},
// ListWorkersResponse, ListFabricsResponse (web/json.h). Lists are cut so that they stay small: of
// jobs the unfinished ones come first, those that run before those that wait, and those that have
// ended without their stages.
enum class Section : std::uint8_t { kJobs, kWorkers, kFabrics };
inline constexpr std::size_t kSections = 3;
inline constexpr std::size_t kUnfinishedJobsShown = 100;
inline constexpr std::size_t kEndedJobsShown = 50;
inline constexpr int kWorkersShown = 500;
inline constexpr int kFabricsShown = 500;

// One picture of the coordinator's state for all who watch: made by one thread, about once a second
// and only while somebody watches, so that the scheduler's lock is asked for no more often however
// many watch, and is never held while anything is sent. Any thread.
class Board {
 public:
  // `scheduler` must outlive the board.
  explicit Board(Scheduler& scheduler);
  ~Board();
  Board(const Board&) = delete;
  Board& operator=(const Board&) = delete;
  Board(Board&&) = delete;
  Board& operator=(Board&&) = delete;

  struct View {
    std::uint64_t revision = 0;               // rises when the text changes; 0: there is none yet
    std::shared_ptr<const std::string> text;  // shared: it is sent while the next one is made
  };
  using Views = std::array<View, kSections>;

  // Somebody who watches, for as long as it lives.
  class Watcher {
   public:
    explicit Watcher(Board& board);
    ~Watcher();
    Watcher(const Watcher&) = delete;
    Watcher& operator=(const Watcher&) = delete;
    Watcher(Watcher&&) = delete;
    Watcher& operator=(Watcher&&) = delete;

    // What there is, as soon as a section is newer than in `seen`, or after `timeout`.
    [[nodiscard]] Views wait(const Views& seen, std::chrono::milliseconds timeout) const;
    [[nodiscard]] bool is_over() const;  // stop() was called

   private:
    Board& board_;
  };

  [[nodiscard]] int watchers() const;
  // Wakes all who wait.
  void stop();

 private:
  void keep_up();
  void look(bool with_fabrics);
  [[nodiscard]] std::string jobs() const;
  void put(Section section, std::string text);

  Scheduler& scheduler_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  int watchers_ = 0;
  bool is_stopped_ = false;
  Views views_;
  std::thread thread_;
};

}  // namespace weft::coordinator
