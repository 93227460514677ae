#pragma once

#include <functional>
#include <memory>
#include <string>

#include "tests/simulation/checks.h"
#include "tests/simulation/coordinator_model.h"
#include "tests/simulation/ground.h"

namespace weft::simulation {

// People who submit jobs and give orders. Each order is repeated until it is answered.
class Client {
 public:
  Client(Ground& ground, Checks& checks, CoordinatorModel& coordinator)
      : ground_(ground), checks_(checks), coordinator_(coordinator) {}

  using Then = std::function<void()>;
  void submit(const JobRow& job, Then then);
  void cancel(const std::string& job, Then then);
  void retry(const std::string& job, Then then);
  void pause(const std::string& job, bool is_paused, Then then);
  void prioritise(const std::string& job, std::int32_t priority, Then then);
  void unblock(const std::string& worker, StageName stage, Then then);
  void drain(const std::string& worker, bool is_drained, Then then);

  // Orders that have no answer yet.
  [[nodiscard]] std::uint64_t waiting() const { return waiting_; }
  [[nodiscard]] const std::set<std::string>& cancelled() const { return cancelled_; }

 private:
  using Order = std::function<void(CoordinatorModel::Done)>;
  void insist(Order order, Then answered);
  void ask(const Order& order, const std::shared_ptr<bool>& is_answered, const Then& answered);

  Ground& ground_;
  Checks& checks_;
  CoordinatorModel& coordinator_;
  std::uint64_t waiting_ = 0;
  std::set<std::string> cancelled_;  // asked for, answered or not
};

}  // namespace weft::simulation
