#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/queue/events.h"
#include "core/error.h"
#include "proto/weft/v1/cluster.pb.h"

namespace weft::coordinator {

// How an exchange with a worker is answered: with a response; with nothing when a newer call of the
// worker came or this one was abandoned; or with what went wrong.
using ExchangeAnswer =
    std::function<void(std::optional<v1::SynchronizeResponse>, const std::optional<core::Error>&)>;

// Workers' calls to which there is nothing to say yet, at most one of each worker, and which of
// them something concerns: so that a change need not be put to all of them. Holds no thread for a
// call. Used by one thread at a time.
class WaitingCalls {
 public:
  struct Call {
    ReportEvent report;
    std::uint64_t sequence = 0;
    Time deadline{};
    ExchangeAnswer answer;
  };

  // REQUIRES: no call of that worker waits.
  void keep(Call call);
  [[nodiscard]] const Call* find(const std::string& worker) const;
  std::optional<Call> take(const std::string& worker);
  std::vector<Call> take_all();

  // Whoever lists this attempt is concerned: it must be told to stop.
  void attempt_ended(std::uint64_t attempt);

  // Workers whose calls are to be looked at; each answer is given once.
  std::optional<std::string> next_concerned();
  // A call whose deadline is over, if there is one. The caller takes it.
  [[nodiscard]] std::optional<std::string> next_due(Time now) const;
  // The next call in turn that wants work or has completions that could not be judged yet.
  std::optional<std::string> next_hungry();
  [[nodiscard]] std::size_t hungry() const { return hungry_.size(); }

  [[nodiscard]] bool has_concerned() const { return !concerned_.empty(); }
  [[nodiscard]] std::optional<Time> first_deadline() const;
  [[nodiscard]] std::size_t size() const { return calls_.size(); }

 private:
  std::map<std::string, Call> calls_;  // by worker
  std::set<std::pair<Time, std::string>> deadlines_;
  std::set<std::pair<std::uint64_t, std::string>> listed_;  // attempt, worker
  std::set<std::pair<std::uint64_t, std::string>> hungry_;  // turn, worker
  std::map<std::string, std::uint64_t> turns_;              // of hungry ones
  std::uint64_t next_turn_ = 0;
  std::set<std::string> concerned_;
};

}  // namespace weft::coordinator
