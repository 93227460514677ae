#include <memory>

#include <gtest/gtest.h>

#include "core/random.h"
#include "tests/queue_cluster.h"
#include "tests/queue_invariants.h"

// Whole clusters with faults of every kind, from one seed: every job ends with the results that an
// undisturbed cluster gives, no result is recorded twice, and shards are never lost.

namespace weft::coordinator {
namespace {

struct Weather {
  bool liar = false;      // worker "m1" gives wrong results now and then
  bool orders = false;    // people pause, resume, drain, undrain and change priorities
  bool restarts = false;  // of the coordinator
  double audit = 0;
};

class QueueClusters : public testing::TestWithParam<std::uint64_t> {
 protected:
  struct Member {
    std::unique_ptr<QueueWorker> worker;
    std::string name;
    std::uint64_t silent_until = 0;  // turns
  };

  void start(Member& member) {
    ++started_;
    member.worker =
        std::make_unique<QueueWorker>(*cluster_, std::string("w").append(std::to_string(started_)),
                                      1 + random_.below(4), member.name);
  }

  void end_attempt(Member& member) {
    QueueWorker& worker = *member.worker;
    const std::uint32_t fate = random_.below(24);
    const bool lies = weather_.liar && member.name == "m1" && random_.below(3) == 0;
    const std::string lie = lies ? std::to_string(random_.below(1'000'000)) : "";
    if (fate == 0) {
      worker.fail("it burns");
    } else if (fate == 1) {
      worker.fail("out of memory", true);
    } else if (fate == 2) {
      worker.finish(random_.below(5'000), random_.below(3), lie);
    } else if (fate < 20) {
      worker.finish(random_.below(5'000), ~std::uint64_t{0}, lie);
    }  // else it is slow
  }

  void turn(Member& member, std::uint64_t now) {
    if (now < member.silent_until) {
      return;
    }
    QueueWorker& worker = *member.worker;
    if (!worker.held.empty() && random_.below(3) != 0) {
      end_attempt(member);
    }
    const Reply reply = worker.send(random_.below(3));
    if (random_.below(8) != 0) {  // else the answer is lost
      worker.receive(reply);
    }
    if (random_.below(15) == 0) {
      member.silent_until = now + random_.below(60);  // may outlast its leases
    }
    if (random_.below(40) == 0) {  // killed, and started again under its name
      if (random_.below(2) == 0) {
        cluster_->apply(DisconnectEvent{worker.says().worker});
      }
      start(member);
    }
  }

  void order(const std::vector<std::string>& jobs) {
    const std::string& job = jobs[random_.below(static_cast<std::uint32_t>(jobs.size()))];
    switch (random_.below(60)) {
      case 0:
        cluster_->apply(PauseEvent{job, true});
        paused_.insert(job);
        break;
      case 1:
        cluster_->apply(PriorityEvent{job, static_cast<std::int32_t>(random_.below(9))});
        break;
      case 2:
        cluster_->apply(DrainEvent{"m2", random_.below(2) == 0});
        break;
      default:
        if (!paused_.empty() && random_.below(10) == 0) {
          cluster_->apply(PauseEvent{*paused_.begin(), false});
          paused_.erase(paused_.begin());
        }
    }
  }

  // Plays until the jobs have ended.
  void play(const Weather& weather) {
    weather_ = weather;
    std::vector<Member> members(5);
    for (std::size_t i = 0; i < members.size(); ++i) {
      members[i].name = std::string("m").append(std::to_string(i));
      start(members[i]);
    }
    JobDemands demands;
    demands.audit = weather.audit;
    const std::vector<std::string> jobs = {"a", "b", "c"};
    cluster_->submit("a", {1, 20, 3, 17}, "same", {}, demands);
    demands.user = "second";
    cluster_->submit("b", {1, 20, 5}, "same", {}, demands);
    cluster_->submit("c", {1, 9}, "other", {}, demands);
    std::uint64_t turns = 0;
    for (; cluster_->ended.size() < jobs.size() && turns < 20'000; ++turns) {
      cluster_->advance(random_.below(2'000));
      if (weather.orders) {
        order(jobs);
      }
      if (weather.restarts && random_.below(150) == 0) {
        cluster_->restart();
        paused_.clear();
      }
      turn(members[random_.below(static_cast<std::uint32_t>(members.size()))], turns);
      ASSERT_NO_FATAL_FAILURE(check_queue(cluster_->queue, cluster_->now))
          << "seed " << GetParam() << " turn " << turns;
      ASSERT_EQ(cluster_->open_attempts.size(), cluster_->queue.attempts().size())
          << "seed " << GetParam() << " turn " << turns;
    }
    ASSERT_EQ(cluster_->ended.size(), jobs.size()) << "seed " << GetParam();
    for (const JobState* job : cluster_->queue.jobs()) {
      ASSERT_EQ(job->phase, JobPhase::kSucceeded) << job->error << " seed " << GetParam();
      for (const StageState& stage : job->stages) {
        for (std::size_t i = 0; i < stage.shards.size(); ++i) {
          ASSERT_EQ(stage.results[i], QueueCluster::result_of(stage.digests[i]))
              << "seed " << GetParam();
        }
      }
    }
    for (const auto& [work, times] : cluster_->results_recorded) {
      EXPECT_EQ(times, 1);
    }
    EXPECT_TRUE(cluster_->queue.attempts().empty());
  }

  core::Random random_{GetParam(), 7};
  QueueSettings settings_ = [] {
    QueueSettings settings;
    settings.failure_limit = 1'000;  // so that chance alone does not fail a job
    settings.same_error_limit = 1'000;
    settings.lonely_loss_limit = 1'000;
    settings.unconfirmed_loss_limit = 1'000;
    settings.block_limit = 1'000;
    settings.hung_ms = 120'000;
    return settings;
  }();
  std::unique_ptr<QueueCluster> cluster_ = std::make_unique<QueueCluster>(settings_);
  Weather weather_;
  std::set<std::string> paused_;
  int started_ = 0;
};

TEST_P(QueueClusters, EveryJobEndsWithTheSameResultsUnderAnyFaults) { play({}); }

TEST_P(QueueClusters, OrdersAndRestarts_ChangeNoResult) {
  play({.liar = false, .orders = true, .restarts = true, .audit = 0.3});
}

TEST_P(QueueClusters, ALiar_IsFoundWhenAllIsAudited) {
  play({.liar = true, .orders = false, .restarts = false, .audit = 1});
  for (const auto& [worker, is_liar] : cluster_->blocked) {
    EXPECT_EQ(worker.first, "m1");
    EXPECT_TRUE(is_liar);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, QueueClusters, testing::Range<std::uint64_t>(1, 61));

}  // namespace
}  // namespace weft::coordinator
