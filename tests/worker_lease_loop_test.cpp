#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/worker_fake_coordinator.h"
#include "worker/lease_loop.h"

// A whole worker in the process, against a coordinator that says what the test wants.

namespace weft::worker {
namespace {

namespace fs = std::filesystem;

// Threads of bakers that wait for a test.
struct Gate {
  std::atomic<bool> is_open{false};
  std::atomic<int> begun{0};
  std::atomic<int> inside{0};
};

// The shard's number as the result. Shard 13 fails; shards from 100 on ignore should_stop and wait
// for the gate; shards from 50 on wait until they are told to stop.
class FakeBaker : public Baker {
 public:
  explicit FakeBaker(std::shared_ptr<Gate> gate) : gate_(std::move(gate)) {}
  std::string bake(std::uint64_t shard, const std::string& /*shard_input*/,
                   const std::function<bool()>& should_stop) const override {
    constexpr std::chrono::milliseconds kStep{5};
    if (shard == 13) {
      throw core::Error(core::Code::kInvalidArgument, "thirteen is not to be had");
    }
    ++gate_->begun;
    ++gate_->inside;
    while (shard >= 100 && !gate_->is_open.load()) {
      std::this_thread::sleep_for(kStep);
    }
    while (shard >= 50 && shard < 100) {
      if (should_stop()) {
        --gate_->inside;
        throw core::Error(core::Code::kCancelled, "stopped");
      }
      std::this_thread::sleep_for(kStep);
    }
    --gate_->inside;
    return "result " + std::to_string(shard);
  }

 private:
  std::shared_ptr<Gate> gate_;
};

v1::AttemptName name_of(std::uint64_t attempt) {
  v1::AttemptName name;
  name.set_job_id("j1");
  name.set_attempt(attempt);
  return name;
}

v1::SynchronizeResponse giving(std::uint64_t attempt, std::uint64_t first, std::uint64_t shards) {
  v1::SynchronizeResponse response;
  v1::Assignment& assignment = *response.add_assignments();
  *assignment.mutable_name() = name_of(attempt);
  assignment.set_lease_token("token" + std::to_string(attempt));
  assignment.set_lease_ms(3000);
  assignment.set_stage("visibility");
  assignment.set_fabric("silk");
  assignment.set_shard_count(1000);
  assignment.set_first_shard(first);
  assignment.set_shards(shards);
  return response;
}

v1::SynchronizeResponse stopping(std::uint64_t attempt) {
  v1::SynchronizeResponse response;
  *response.add_stop() = name_of(attempt);
  return response;
}

class LeaseLoopTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "weft_loop_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    options_.name = "loom";
    options_.threads = 2;
    options_.memory_bytes = 1 << 30;
    options_.coordinator = "fake";
    options_.scratch = folder_;
    options_.hung_seconds = 0.1;
    options_.make_baker = [gate = gate_](const BakerContext& /*context*/) {
      return std::make_unique<FakeBaker>(gate);
    };
    options_.end_process = [this](int code) {
      exit_code_.store(code);
      gate_->is_open.store(true);
    };
  }
  void TearDown() override {
    end();
    fs::remove_all(folder_);
  }

  void start() {
    should_leave_.store(false);
    loop_ = std::make_unique<LeaseLoop>(options_, coordinator_.channel());
    thread_ = std::thread([this] { loop_->run([this] { return should_leave_.load(); }); });
  }
  void end() {
    should_leave_.store(true);
    if (thread_.joinable()) {
      thread_.join();
    }
    loop_.reset();
  }
  v1::Completion completion_of(std::uint64_t attempt) {
    const auto is_it = [&](const v1::Completion& c) { return c.attempt() == attempt; };
    const v1::SynchronizeRequest request = coordinator_.wait_for([&](const auto& r) {
      return std::any_of(r.completions().begin(), r.completions().end(), is_it);
    });
    const auto found =
        std::find_if(request.completions().begin(), request.completions().end(), is_it);
    return found == request.completions().end() ? v1::Completion() : *found;
  }
  [[nodiscard]] fs::path spool_root() const {
    return folder_ / "spool" / core::digest_of("fake").hex().substr(0, 12);
  }

  FakeCoordinator coordinator_;
  fs::path folder_;
  std::shared_ptr<Gate> gate_ = std::make_shared<Gate>();
  WorkerOptions options_;
  std::atomic<int> exit_code_{-1};
  std::atomic<bool> should_leave_{false};
  std::unique_ptr<LeaseLoop> loop_;
  std::thread thread_;
};

TEST_F(LeaseLoopTest, ComputesWhatItIsGivenAndLogsIt) {
  coordinator_.say(giving(1, 10, 3));
  start();
  const v1::Completion completion = completion_of(1);
  EXPECT_EQ(completion.lease_token(), "token1");
  ASSERT_EQ(completion.results_size(), 3);
  EXPECT_TRUE(coordinator_.has_blob(core::digest_of("result 10")));
  EXPECT_TRUE(coordinator_.wait_for_log(1, "ended: 3 of 3 shards")) << coordinator_.log_of(1);
  const std::string log = coordinator_.log_of(1);
  EXPECT_NE(log.find("begins on loom"), std::string::npos) << log;
  EXPECT_NE(log.find("visibility of silk, shards 10 to 12 of 1000"), std::string::npos) << log;
  EXPECT_NE(log.find("stage prepared in"), std::string::npos) << log;
  EXPECT_NE(log.find("computed in"), std::string::npos) << log;
  end();
  EXPECT_TRUE(fs::is_empty(spool_root())) << "what is acknowledged needs no spool";
}

TEST_F(LeaseLoopTest, AFailureIsReportedAndItsTextIsInTheLog) {
  coordinator_.say(giving(1, 12, 2));
  start();
  const v1::Completion completion = completion_of(1);
  EXPECT_EQ(completion.error().kind(), v1::ERROR_KIND_TASK_FAILED);
  EXPECT_EQ(completion.error().shard(), 13U);
  EXPECT_TRUE(
      coordinator_.wait_for_log(1, "error: shard 13: task_failed: thirteen is not to be had"));
}

TEST_F(LeaseLoopTest, TellsItsLabelsItsLimitItsScenesAndHowFarItIs) {
  options_.labels = {"gpu", "room=12"};
  options_.wall_limit_seconds = 1000;
  v1::SynchronizeResponse response = giving(1, 50, 1);
  const core::Digest tile = core::digest_of("");
  response.mutable_assignments(0)->add_inputs(tile.binary());
  {
    const auto stub = v1::BlobService::NewStub(coordinator_.channel());
    grpc::ClientContext context;
    v1::WriteResponse written;
    const auto writer = stub->Write(&context, &written);
    v1::WriteRequest request;
    request.set_digest(tile.binary());
    writer->Write(request);
    writer->WritesDone();
    ASSERT_TRUE(writer->Finish().ok());
  }
  coordinator_.say(response);
  start();
  const v1::SynchronizeRequest request = coordinator_.wait_for([](const auto& r) {
    return r.running_size() == 1 && r.running(0).progress() > 5 && r.scenes_size() == 1;
  });
  ASSERT_EQ(request.running_size(), 1);
  EXPECT_EQ(request.labels_size(), 2);
  EXPECT_GT(request.wall_left_ms(), 900'000U);
  EXPECT_LT(request.wall_left_ms(), 1'000'000U);
  EXPECT_EQ(request.scenes(0), tile.binary());
  EXPECT_NE(request.running(0).last_line(), "");
  const std::uint64_t progress = request.running(0).progress();
  const v1::SynchronizeRequest later = coordinator_.wait_for(
      [&](const auto& r) { return r.running_size() == 1 && r.running(0).progress() > progress; });
  EXPECT_EQ(later.running_size(), 1) << "the progress stands still";
}

TEST_F(LeaseLoopTest, ResultsThatCouldNotBeUploadedAreReportedByTheNextWorker) {
  coordinator_.refuse_blobs(true);
  coordinator_.say(giving(1, 3, 1));
  start();
  const std::string name = core::digest_of("result 3").hex();
  const auto is_kept = [&] {
    for (const auto& item : fs::recursive_directory_iterator(folder_)) {
      if (item.path().filename().string().find(name) != std::string::npos) {
        return true;
      }
    }
    return false;
  };
  for (int i = 0; i < 1000 && !is_kept(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  end();  // gives up after some seconds
  ASSERT_TRUE(is_kept());
  ASSERT_FALSE(coordinator_.has_blob(core::digest_of("result 3")));

  coordinator_.refuse_blobs(false);
  start();
  const v1::Completion completion = completion_of(1);
  EXPECT_EQ(completion.lease_token(), "token1") << "its old token";
  ASSERT_EQ(completion.results_size(), 1);
  EXPECT_EQ(completion.results(0).digest(), core::digest_of("result 3").binary());
  EXPECT_TRUE(coordinator_.has_blob(core::digest_of("result 3")));
  const v1::SynchronizeRequest listed =
      coordinator_.wait_for([](const auto& r) { return r.completions_size() == 1; });
  EXPECT_EQ(listed.running_size(), 0) << "it owns nothing of it";
  end();
  EXPECT_TRUE(fs::is_empty(spool_root()));
}

TEST_F(LeaseLoopTest, WhatTheCoordinatorHasNoRoomForIsKeptAndDeliveredLater) {
  coordinator_.refuse_blobs(true, grpc::StatusCode::RESOURCE_EXHAUSTED);
  coordinator_.say(giving(1, 3, 2));
  start();
  const v1::SynchronizeRequest stuck =
      coordinator_.wait_for([](const auto& r) { return !r.undelivered().empty(); });
  EXPECT_NE(stuck.undelivered().find("not now"), std::string::npos) << stuck.undelivered();
  EXPECT_EQ(stuck.free_attempts(), 0U) << "it takes nothing more";
  EXPECT_EQ(stuck.running_size(), 1) << "the attempt is still its own";
  EXPECT_EQ(stuck.completions_size(), 0);
  const v1::SynchronizeRequest still =
      coordinator_.wait_for([&](const auto& r) { return r.sequence() >= stuck.sequence() + 3; });
  EXPECT_FALSE(still.undelivered().empty());
  EXPECT_EQ(still.running_size(), 1);

  coordinator_.refuse_blobs(false);
  const v1::Completion completion = completion_of(1);
  EXPECT_EQ(completion.results_size(), 2);
  EXPECT_FALSE(completion.has_error());
  EXPECT_TRUE(coordinator_.has_blob(core::digest_of("result 3")));
  EXPECT_TRUE(coordinator_.has_blob(core::digest_of("result 4")));
  EXPECT_EQ(gate_->begun.load(), 2) << "something was computed again";
  const v1::SynchronizeRequest free = coordinator_.wait_for(
      [&](const auto& r) { return r.sequence() > still.sequence() && r.undelivered().empty(); });
  EXPECT_GT(free.free_attempts(), 0U) << "it takes work again";
  end();
  EXPECT_TRUE(fs::is_empty(spool_root()));
}

TEST_F(LeaseLoopTest, WhatTheCoordinatorHasNoRoomForOutlivesTheWorker) {
  coordinator_.refuse_blobs(true, grpc::StatusCode::RESOURCE_EXHAUSTED);
  coordinator_.say(giving(1, 3, 1));
  start();
  EXPECT_FALSE(
      coordinator_.wait_for([](const auto& r) { return !r.undelivered().empty(); }).name().empty());
  end();  // gives up after some seconds
  coordinator_.refuse_blobs(false);
  start();
  EXPECT_EQ(completion_of(1).results_size(), 1);
  EXPECT_EQ(gate_->begun.load(), 1);
}

TEST_F(LeaseLoopTest, WhatWasUploadedButNotAcknowledgedIsReportedByTheNextWorker) {
  {
    const SpoolFolder dead = SpoolFolder::make(spool_root(), "dead");
    v1::Completion fragment;
    fragment.set_job_id("j1");
    fragment.set_attempt(8);
    fragment.set_lease_token("old");
    fragment.add_results()->set_shard(4);
    dead.append(1, fragment);
  }
  start();
  const v1::Completion completion = completion_of(8);
  EXPECT_EQ(completion.lease_token(), "old");
  ASSERT_EQ(completion.results_size(), 1);
  EXPECT_EQ(completion.results(0).shard(), 4U);
}

TEST_F(LeaseLoopTest, GoesOnWithItsOtherThreadsWhenOneHangs) {
  coordinator_.say(giving(1, 100, 1));
  start();
  coordinator_.wait_for([](const auto& r) { return r.running_size() == 1; });
  while (gate_->inside.load() == 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  coordinator_.say(stopping(1));
  EXPECT_TRUE(coordinator_.wait_for_log(1, "shard 100 hangs"));
  coordinator_.say(giving(2, 1, 4));
  EXPECT_EQ(completion_of(2).results_size(), 4);
  const v1::SynchronizeRequest request =
      coordinator_.wait_for([](const auto& r) { return r.threads() == 1; });
  EXPECT_EQ(request.threads(), 1U) << "it has one thread less";
  EXPECT_EQ(exit_code_.load(), -1);
  gate_->is_open.store(true);
  const v1::SynchronizeRequest later = coordinator_.wait_for(
      [&](const auto& r) { return r.sequence() > request.sequence() && r.threads() == 2; });
  EXPECT_EQ(later.threads(), 2U) << "the thread came back";
}

TEST_F(LeaseLoopTest, EndsTheProcessWhenEveryThreadHangs) {
  coordinator_.say(giving(1, 100, 2));
  start();
  while (gate_->inside.load() < 2) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  coordinator_.say(stopping(1));
  thread_.join();
  EXPECT_EQ(exit_code_.load(), 1);
}

TEST_F(LeaseLoopTest, EndsByItselfBeforeItsWallLimit) {
  options_.wall_limit_seconds = 1;
  coordinator_.say(giving(1, 49, 2));
  start();
  thread_.join();
  EXPECT_EQ(exit_code_.load(), -1);
  EXPECT_EQ(completion_of(1).results_size(), 1) << "what was finished is reported";
  const v1::SynchronizeRequest last =
      coordinator_.wait_for([](const auto& r) { return r.leaving(); });
  EXPECT_TRUE(last.leaving());
}

TEST_F(LeaseLoopTest, EndsByItselfWhenThereIsNothingToDo) {
  options_.idle_limit_seconds = 0.3;
  coordinator_.say(giving(1, 1, 1));
  start();
  thread_.join();
  EXPECT_EQ(completion_of(1).results_size(), 1);
}

}  // namespace
}  // namespace weft::worker
