#include "coordinator/scheduler/waiting_calls.h"

#include "core/check.h"

namespace weft::coordinator {

void WaitingCalls::keep(Call call) {
  const std::string worker = call.report.worker;
  CHECK(!calls_.contains(worker));
  deadlines_.emplace(call.deadline, worker);
  for (const RunningClaim& claim : call.report.running) {
    listed_.emplace(claim.attempt, worker);
  }
  if (call.report.free_attempts > 0 || !call.report.completions.empty()) {
    turns_[worker] = next_turn_;
    hungry_.emplace(next_turn_++, worker);
  }
  calls_.emplace(worker, std::move(call));
}

const WaitingCalls::Call* WaitingCalls::find(const std::string& worker) const {
  const auto found = calls_.find(worker);
  return found == calls_.end() ? nullptr : &found->second;
}

std::optional<WaitingCalls::Call> WaitingCalls::take(const std::string& worker) {
  const auto found = calls_.find(worker);
  if (found == calls_.end()) {
    return std::nullopt;
  }
  Call call = std::move(found->second);
  calls_.erase(found);
  deadlines_.erase({call.deadline, worker});
  for (const RunningClaim& claim : call.report.running) {
    listed_.erase({claim.attempt, worker});
  }
  const auto turn = turns_.find(worker);
  if (turn != turns_.end()) {
    hungry_.erase({turn->second, worker});
    turns_.erase(turn);
  }
  concerned_.erase(worker);
  return call;
}

std::vector<WaitingCalls::Call> WaitingCalls::take_all() {
  std::vector<Call> all;
  while (!calls_.empty()) {
    all.push_back(*take(std::string(calls_.begin()->first)));
  }
  return all;
}

void WaitingCalls::attempt_ended(std::uint64_t attempt) {
  for (auto it = listed_.lower_bound({attempt, ""}); it != listed_.end() && it->first == attempt;
       ++it) {
    concerned_.insert(it->second);
  }
}

std::optional<std::string> WaitingCalls::next_concerned() {
  if (concerned_.empty()) {
    return std::nullopt;
  }
  return concerned_.extract(concerned_.begin()).value();
}

std::optional<std::string> WaitingCalls::next_due(Time now) const {
  if (deadlines_.empty() || deadlines_.begin()->first > now) {
    return std::nullopt;
  }
  return deadlines_.begin()->second;
}

std::optional<std::string> WaitingCalls::next_hungry() {
  if (hungry_.empty()) {
    return std::nullopt;
  }
  const std::string worker = hungry_.extract(hungry_.begin()).value().second;
  turns_[worker] = next_turn_;
  hungry_.emplace(next_turn_++, worker);
  return worker;
}

std::optional<Time> WaitingCalls::first_deadline() const {
  return deadlines_.empty() ? std::nullopt : std::optional(deadlines_.begin()->first);
}

}  // namespace weft::coordinator
