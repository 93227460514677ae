#include "coordinator/web/board.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "coordinator/scheduler/listings.h"
#include "coordinator/web/json.h"
#include "core/clock.h"
#include "proto/limits.h"

namespace weft::coordinator {

namespace {

constexpr std::chrono::milliseconds kBetweenLooks{1000};
// Looking may take so much of the time at most: a large cluster is looked at less often.
constexpr double kLookingShare = 0.05;
constexpr int kLooksAtFabrics = 3;  // at every third: they change seldom

bool is_newer(const Board::Views& views, const Board::Views& seen) {
  for (std::size_t i = 0; i < kSections; ++i) {
    if (views[i].revision > seen[i].revision) {
      return true;
    }
  }
  return false;
}

}  // namespace

Board::Board(Scheduler& scheduler) : scheduler_(scheduler), thread_([this] { keep_up(); }) {}

Board::~Board() {
  stop();
  thread_.join();
}

void Board::stop() {
  const std::lock_guard lock(mutex_);
  is_stopped_ = true;
  changed_.notify_all();
}

int Board::watchers() const {
  const std::lock_guard lock(mutex_);
  return watchers_;
}

void Board::keep_up() {
  int looks = 0;
  std::unique_lock lock(mutex_);
  while (!is_stopped_) {
    changed_.wait(lock, [this] { return is_stopped_ || watchers_ > 0; });
    if (is_stopped_) {
      return;
    }
    lock.unlock();
    const core::Stopwatch since_start;
    look(looks++ % kLooksAtFabrics == 0);
    const std::chrono::milliseconds rest(
        static_cast<std::int64_t>(1000 * since_start.seconds() / kLookingShare));
    lock.lock();
    changed_.wait_for(lock, std::max(kBetweenLooks, rest), [this] { return is_stopped_; });
  }
}

std::string Board::jobs() const {
  std::vector<v1::Job> unfinished = scheduler_.jobs(true, v1::kListLimit);
  const std::size_t count = unfinished.size();
  std::stable_partition(unfinished.begin(), unfinished.end(), [](const v1::Job& job) {
    return job.state() != v1::JOB_STATE_QUEUED && !job.paused();
  });
  unfinished.resize(std::min(count, kUnfinishedJobsShown));
  v1::ListJobsResponse list;
  for (v1::Job& job : unfinished) {
    list.add_jobs()->Swap(&job);
  }
  std::size_t room = kEndedJobsShown;
  for (v1::Job& job : scheduler_.jobs(false, v1::kListLimit)) {
    if (job.ended_at_ms() != 0 && room > 0) {
      --room;
      job.clear_stages();
      job.clear_troubles();
      list.add_jobs()->Swap(&job);
    }
  }
  return fmt::format(R"({{"unfinished":{},"list":{}}})", count, json_of(list));
}

void Board::look(bool with_fabrics) {
  try {
    put(Section::kJobs, jobs());
    v1::ListWorkersResponse workers;
    for (v1::Worker& worker : scheduler_.workers()) {
      if (workers.workers_size() < kWorkersShown) {
        workers.add_workers()->Swap(&worker);
      }
    }
    put(Section::kWorkers, json_of(workers));
    if (with_fabrics) {
      v1::ListFabricsResponse fabrics = list_fabrics(scheduler_.catalogue());
      if (fabrics.fabrics_size() > kFabricsShown) {
        fabrics.mutable_fabrics()->DeleteSubrange(kFabricsShown,
                                                  fabrics.fabrics_size() - kFabricsShown);
      }
      put(Section::kFabrics, json_of(fabrics));
    }
  } catch (const std::exception& error) {
    spdlog::warn("event=page_not_renewed message=\"{}\"", error.what());
  }
}

void Board::put(Section section, std::string text) {
  const std::lock_guard lock(mutex_);
  View& view = views_[static_cast<std::size_t>(section)];
  if (view.text != nullptr && *view.text == text) {
    return;
  }
  view.text = std::make_shared<const std::string>(std::move(text));
  ++view.revision;
  changed_.notify_all();
}

Board::Watcher::Watcher(Board& board) : board_(board) {
  const std::lock_guard lock(board_.mutex_);
  ++board_.watchers_;
  board_.changed_.notify_all();
}

Board::Watcher::~Watcher() {
  const std::lock_guard lock(board_.mutex_);
  --board_.watchers_;
}

Board::Views Board::Watcher::wait(const Views& seen, std::chrono::milliseconds timeout) const {
  std::unique_lock lock(board_.mutex_);
  board_.changed_.wait_for(lock, timeout,
                           [&] { return board_.is_stopped_ || is_newer(board_.views_, seen); });
  return board_.views_;
}

bool Board::Watcher::is_over() const {
  const std::lock_guard lock(board_.mutex_);
  return board_.is_stopped_;
}

}  // namespace weft::coordinator
