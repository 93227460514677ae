#include <chrono>
#include <thread>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/error.h"
#include "worker/lease_loop.h"

// What a worker sees to once a second: what dead processes left behind, threads that hang, and that
// results which wait for the coordinator survive a power loss.

namespace weft::worker {

namespace {

constexpr std::chrono::seconds kPeriod{1};
constexpr double kOrphansSeconds = 10;
constexpr std::chrono::milliseconds kPoll{20};

}  // namespace

void LeaseLoop::keep_house() {
  std::optional<core::Stopwatch> since_orphans;
  while (!is_leaving_.load()) {
    if (!since_orphans || since_orphans->seconds() > kOrphansSeconds) {
      since_orphans.emplace();
      take_over_orphans();
    }
    watch_seats();
    try {
      spool_.sync();
    } catch (const core::Error& error) {
      spdlog::warn("worker={} event=not_synced error=\"{}\"", id_, error.what());
    }
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kPeriod, [this] { return is_leaving_.load(); });
  }
}

void LeaseLoop::take_over_orphans() {
  for (Spool::Orphan& orphan : spool_.take_over()) {
    std::shared_ptr<Attempt> attempt;
    {
      const std::lock_guard lock(mutex_);
      attempt = table_.take_over(orphan.completion, orphan.items.size());
    }
    spdlog::info("worker={} {} results={} undelivered={} state=taken_over", id_, log_name(*attempt),
                 orphan.completion.results_size(), orphan.items.size());
    for (SpoolItem& item : orphan.items) {
      item.claim.attempt = attempt;
      spool_.enter(item);
    }
    if (orphan.items.empty()) {
      tell_news();
    }
  }
  forget_what_is_over();
}

// Gives up threads that were told to stop and do not: their attempts end without them.
void LeaseLoop::watch_seats() {
  std::vector<ShardClaim> hung;
  {
    const std::lock_guard lock(mutex_);
    for (Seat& seat : seats_) {
      if (!seat.claim || seat.is_given_up || !seat.claim->attempt->should_stop.load()) {
        continue;
      }
      if (!seat.since_stop) {
        seat.since_stop.emplace();
      } else if (seat.since_stop->seconds() > options_.hung_seconds) {
        seat.is_given_up = true;
        ++stuck_;
        table_.given_up(*seat.claim);
        hung.push_back(*seat.claim);
      }
    }
  }
  for (const ShardClaim& claim : hung) {
    spdlog::error("worker={} {} shard={} state=hung: a thread was told to stop and does not", id_,
                  log_name(*claim.attempt), claim.shard);
    claim.attempt->log.add_important(
        fmt::format("shard {} hangs: its thread was told to stop {} s ago and does not",
                    claim.shard, options_.hung_seconds));
  }
  if (!hung.empty()) {
    tell_news();
    forget_what_is_over();
  }
}

// Whether all threads have put down what they had in hand.
bool LeaseLoop::wait_for_seats(double seconds) {
  const core::Stopwatch since_start;
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      bool is_quiet = true;
      for (const Seat& seat : seats_) {
        is_quiet = is_quiet && !seat.claim;
      }
      if (is_quiet || since_start.seconds() > seconds) {
        return is_quiet;
      }
    }
    std::this_thread::sleep_for(kPoll);
  }
}

}  // namespace weft::worker
