#pragma once

#include <cstdint>
#include <future>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "coordinator/scheduler/scheduler.h"
#include "core/digest.h"
#include "core/error.h"
#include "tests/coordinator_fabric.h"

namespace weft::coordinator {

// A worker that talks to the scheduler itself, and keeps what was not acknowledged.
class DirectWorker {
 public:
  DirectWorker() {
    report_.worker = "w";
    report_.name = "w";
    report_.threads = 4;
    report_.fingerprint = core::digest_of("a machine");
    report_.free_attempts = 2;
  }

  // One exchange. Throws core::Error when the scheduler can promise nothing any more.
  void turn(Scheduler& scheduler) {
    std::promise<std::pair<std::optional<v1::SynchronizeResponse>, std::optional<core::Error>>>
        answer;
    scheduler.synchronize(report_, ++sequence_, std::chrono::milliseconds(20),
                          [&](std::optional<v1::SynchronizeResponse> response,
                              const std::optional<core::Error>& problem) {
                            answer.set_value({std::move(response), problem});
                          });
    const auto [response, problem] = answer.get_future().get();
    if (problem) {
      throw core::Error(*problem);
    }
    ASSERT_TRUE(response.has_value());
    for (const v1::AttemptName& name : response->acknowledged()) {
      std::erase_if(report_.completions, [&](const CompletionClaim& claim) {
        if (claim.attempt != name.attempt()) {
          return false;
        }
        for (const ShardResult& result : claim.results) {
          acknowledged.insert(names_.at(claim.attempt) + std::to_string(result.shard));
        }
        return true;
      });
    }
    for (const v1::Assignment& assignment : response->assignments()) {
      compute(scheduler, assignment);
    }
  }

  // As one whose scratch folder is gone.
  void lose_unacknowledged() { report_.completions.clear(); }

  std::set<std::string> acknowledged;    // "stage shard"
  std::vector<std::string> given_twice;  // that was acknowledged before

 private:
  void compute(Scheduler& scheduler, const v1::Assignment& assignment) {
    CompletionClaim claim{assignment.name().job_id(),
                          assignment.name().attempt(),
                          assignment.lease_token(),
                          {},
                          {},
                          10};
    names_[claim.attempt] = assignment.stage() + " ";
    for (std::uint64_t i = 0; i < assignment.shards(); ++i) {
      const std::uint64_t shard = assignment.first_shard() + i;
      if (acknowledged.contains(names_[claim.attempt] + std::to_string(shard))) {
        given_twice.push_back(names_[claim.attempt] + std::to_string(shard));
      }
      const std::string bytes = fake_result(assignment.spec(), shard);
      try {
        claim.results.push_back({shard, scheduler.blobs().put(bytes), bytes.size()});
      } catch (const core::Error& error) {
        claim.failure = Failure{true, shard, error.what()};
        break;
      }
    }
    report_.completions.push_back(std::move(claim));
  }

  ReportEvent report_;
  std::uint64_t sequence_ = 0;
  std::map<std::uint64_t, std::string> names_;  // of attempts
};

}  // namespace weft::coordinator
