#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "coordinator/queue/queue.h"
#include "tests/simulation/disk.h"
#include "tests/simulation/ground.h"

// What must hold at every step. Sees everything, also what no process of the cluster can know; each
// check throws Violation.

namespace weft::simulation {

class Checks {
 public:
  Checks(const Ground& ground, const coordinator::QueueSettings& settings)
      : ground_(ground), settings_(settings) {}

  // Around each event of the queue.
  void before(const coordinator::Queue& queue, const coordinator::Event& event, Time now);
  void after(const coordinator::Queue& queue, const coordinator::Event& event,
             const coordinator::Actions& actions, Time now);
  void coordinator_died();
  // The result of that work is known and its blob is not there: it may come again.
  void unavailable(const core::Digest& work);
  void loaded(const coordinator::Queue& queue, const Tables& tables);

  // The works of which the answer to a report acknowledges results that somebody wants.
  [[nodiscard]] std::vector<core::Digest> acknowledged(const coordinator::ReportEvent& report,
                                                       const coordinator::Reply& reply,
                                                       const coordinator::Queue& queue) const;
  // That answer leaves the coordinator.
  void answered(const std::vector<core::Digest>& acknowledged, const coordinator::Reply& reply,
                const Tables& durable) const;

  // A client has its answer.
  void submitted(const std::string& job) { submitted_.insert(job); }
  void cancelled(const std::string& job) { cancelled_.insert(job); }
  void retried(const std::string& job) { cancelled_.erase(job); }
  // What the client was told last; nothing while a new order of that kind is under way.
  void paused(const std::string& job, std::optional<bool> is_paused);
  void drained(const std::string& worker, std::optional<bool> is_drained);

  // Whatever was acknowledged is still there.
  void check_promises(const Tables& tables, const coordinator::Queue* queue) const;

  // Shards that were computed, by anybody; for the comparison with what was assigned.
  void computed(std::uint64_t attempt, std::uint64_t shard);

  // A shard's failures that counted, as the queue recorded them: whether a quarantine is deserved.
  [[nodiscard]] bool is_rightly_given_up(const std::string& job) const;
  // Whether results of the job were not audited for want of workers, or a dispute was not settled.
  [[nodiscard]] bool is_unaudited(const std::string& job) const { return unaudited_.contains(job); }
  [[nodiscard]] std::uint64_t events() const { return events_; }

 private:
  struct Given {
    std::string job;
    StageName stage{};
    std::uint64_t first_shard = 0;
    std::vector<core::Digest> works;
    std::string worker;  // id
    coordinator::Purpose purpose{};
    std::map<std::uint64_t, int> computed;  // by shard
  };
  struct ShardName {
    std::string job;
    StageName stage{};
    std::uint64_t shard = 0;
    auto operator<=>(const ShardName&) const = default;  // NOLINT(modernize-use-nullptr)
  };
  struct Verdicts {
    std::uint32_t failures = 0;
    std::uint32_t losses = 0;
    std::map<std::string, std::set<std::string>> workers_by_message;
    bool all_failed = false;  // on every worker that was there
  };

  void check_assignments(const coordinator::Queue& queue, const coordinator::ReportEvent& report,
                         const coordinator::Actions& actions);
  void check_new_assignment(const coordinator::Queue& queue, const coordinator::ReportEvent& report,
                            const coordinator::AssignAction& assign);
  void check_failures(const coordinator::Queue& queue, const coordinator::Event& event,
                      const coordinator::Actions& actions, Time now);
  void check_results(const coordinator::Event& event, const coordinator::Actions& actions);
  void check_freed(const coordinator::Queue& queue, const coordinator::ReportEvent& report,
                   const coordinator::Actions& actions, Time now);
  void check_state(const coordinator::Queue& queue);
  [[nodiscard]] static bool is_wanted(const coordinator::JobState& job, const Given& given);
  static void check_troubles(const coordinator::JobState& job);
  void check_attempts(const coordinator::Queue& queue) const;

  const Ground& ground_;
  const coordinator::QueueSettings settings_;
  std::uint64_t events_ = 0;
  std::uint32_t epoch_ = 0;  // of the coordinator
  Time last_{};
  bool has_jumped_ = false;
  std::map<std::uint64_t, coordinator::Attempt> before_;  // the event
  std::map<std::uint64_t, Given> given_;                  // by attempt, of all epochs
  std::map<core::Digest, core::Digest> accepted_;         // work: result, as the queue knows it
  std::set<core::Digest> excused_;  // works whose results were lost or dropped
  std::map<ShardName, Verdicts> verdicts_;
  std::set<std::string> submitted_;
  std::set<std::string> cancelled_;
  std::set<std::string> unaudited_;
  std::map<std::string, bool> paused_;
  std::map<std::string, bool> drained_;
};

}  // namespace weft::simulation
