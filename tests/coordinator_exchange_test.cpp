#include <filesystem>
#include <fstream>
#include <future>
#include <thread>

#include "tests/coordinator_service_fixture.h"

namespace weft::coordinator {
namespace {

// How calls of workers wait, and what is made of it when their connections close.
class ExchangeTest : public ServiceTest {
 protected:
  void configure(SchedulerOptions& options) override { options.queue.disconnect_ms = 200; }

  // The outcome of the job's only attempt, once it has one.
  std::string outcome_of(const std::string& job) {
    v1::ListAttemptsRequest request;
    request.set_job_id(job);
    for (;;) {
      const std::vector<v1::AttemptInfo> attempts = scheduler_->attempts(request);
      if (!attempts.empty() && attempts.back().outcome() != "running") {
        return attempts.back().outcome();
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  static std::size_t threads() {
    const std::filesystem::directory_iterator tasks("/proc/self/task");
    return static_cast<std::size_t>(std::distance(begin(tasks), end(tasks)));
  }
  // An answer that the worker did not see, made into what it runs.
  static void take(const v1::SynchronizeResponse& response, v1::SynchronizeRequest& request) {
    for (const v1::Assignment& assignment : response.assignments()) {
      v1::RunningAttempt& running = *request.add_running();
      running.set_job_id(assignment.name().job_id());
      running.set_attempt(assignment.name().attempt());
      running.set_lease_token(assignment.lease_token());
    }
  }
  // A call that waits for long, and can be cancelled.
  struct Pending {
    grpc::ClientContext context;
    v1::SynchronizeResponse response;
    std::promise<grpc::Status> status;
  };
  std::unique_ptr<Pending> begin_call(v1::WorkerService::Stub& stub,
                                      v1::SynchronizeRequest& request) {
    auto pending = std::make_unique<Pending>();
    request.set_sequence(request.sequence() + 1);
    request.set_request_id(std::string("call-").append(std::to_string(request.sequence())));
    Pending* const call = pending.get();
    stub.async()->Synchronize(
        &call->context, &request, &call->response,
        [call](const grpc::Status& status) { call->status.set_value(status); });
    return pending;
  }
};

TEST_F(ExchangeTest, ClosedConnection_FreesTheWorkersShardsSoon) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  FakeWorker worker(channel_, "w");
  v1::SynchronizeResponse response;
  ASSERT_TRUE(worker.exchange(&response).ok());
  ASSERT_EQ(response.assignments_size(), 1);
  v1::SynchronizeRequest request = worker.request();
  take(response, request);
  request.set_wait_ms(30'000);
  request.set_free_attempts(0);
  const auto stub = v1::WorkerService::NewStub(channel_);
  const auto pending = begin_call(*stub, request);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  pending->context.TryCancel();
  EXPECT_EQ(pending->status.get_future().get().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(outcome_of(submitted.id()), "lost");  // long before the lease of 30 s is over
}

TEST_F(ExchangeTest, CancelledCallWithANewerOneAtOnce_IsNoLoss) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  FakeWorker worker(channel_, "w");
  v1::SynchronizeResponse response;
  ASSERT_TRUE(worker.exchange(&response).ok());
  v1::SynchronizeRequest request = worker.request();
  take(response, request);
  request.set_free_attempts(0);
  request.set_wait_ms(30'000);
  const auto stub = v1::WorkerService::NewStub(channel_);
  for (int i = 0; i < 3; ++i) {
    const auto pending = begin_call(*stub, request);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    pending->context.TryCancel();
    (void)pending->status.get_future().get();
  }
  request.set_wait_ms(1000);  // five times disconnect_ms, counted from the last cancellation
  const auto last = begin_call(*stub, request);
  EXPECT_TRUE(last->status.get_future().get().ok());
  EXPECT_EQ(last->response.leases_size(), 1);
  EXPECT_EQ(last->response.stop_size(), 0);
}

TEST_F(ExchangeTest, WaitingCalls_HoldNoThreads) {
  constexpr int kWorkers = 300;
  const auto stub = v1::WorkerService::NewStub(channel_);
  std::vector<v1::SynchronizeRequest> requests(kWorkers, FakeWorker(channel_, "w").request());
  std::vector<std::unique_ptr<Pending>> calls;
  const std::size_t before = threads();
  for (int i = 0; i < kWorkers; ++i) {
    requests[static_cast<std::size_t>(i)].set_worker_id(std::string("w").append(std::to_string(i)));
    requests[static_cast<std::size_t>(i)].set_wait_ms(30'000);
    calls.push_back(begin_call(*stub, requests[static_cast<std::size_t>(i)]));
  }
  while (scheduler_->workers().size() < kWorkers) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_LT(threads(), before + 50);
  // One of them is given the one shard that there is; the others go on waiting.
  ASSERT_TRUE(submit("r1", small_description()).ok());
  const auto answered = [&] {
    int count = 0;
    for (const auto& call : calls) {
      count += call->response.assignments_size();
    }
    return count;
  };
  v1::ListAttemptsRequest of_job;
  of_job.set_job_id(scheduler_->jobs(false, 1).front().id());
  while (scheduler_->attempts(of_job).empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  stop();  // ends the others
  int unavailable = 0;
  for (const auto& call : calls) {
    const grpc::Status status = call->status.get_future().get();
    unavailable += status.error_code() == grpc::StatusCode::UNAVAILABLE ? 1 : 0;
  }
  EXPECT_EQ(answered(), 1);
  EXPECT_EQ(unavailable, kWorkers - 1);
}

TEST_F(ExchangeTest, PausedJob_StopsItsAttemptInTheCallThatWaits) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  FakeWorker worker(channel_, "w");
  v1::SynchronizeResponse response;
  ASSERT_TRUE(worker.exchange(&response).ok());
  v1::SynchronizeRequest request = worker.request();
  take(response, request);
  request.set_free_attempts(0);
  request.set_wait_ms(30'000);
  const auto stub = v1::WorkerService::NewStub(channel_);
  const auto pending = begin_call(*stub, request);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  (void)scheduler_->pause({"p1", submitted.id(), {"", {v1::ROLE_ADMIN}}}, true);
  EXPECT_TRUE(pending->status.get_future().get().ok());
  ASSERT_EQ(pending->response.stop_size(), 1);
  EXPECT_EQ(pending->response.stop(0).attempt(), request.running(0).attempt());
}

TEST_F(ExchangeTest, RestartedCoordinator_RequeuesNothing) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  FakeWorker worker(channel_, "w");
  v1::SynchronizeResponse response;
  ASSERT_TRUE(worker.exchange(&response).ok());
  ASSERT_EQ(response.assignments_size(), 1);
  v1::SynchronizeRequest request = worker.request();
  take(response, request);
  stop();
  start();
  // Another worker is there first and gets nothing; then the first one comes back.
  FakeWorker eager(channel_, "eager");
  eager.request().set_wait_ms(500);
  EXPECT_FALSE(eager.work());
  FakeWorker same(channel_, "w");
  same.request() = request;
  same.request().set_wait_ms(100);
  v1::SynchronizeResponse renewed;
  ASSERT_TRUE(same.exchange(&renewed).ok());
  ASSERT_EQ(renewed.leases_size(), 1);
  EXPECT_EQ(renewed.leases(0).name().attempt(), request.running(0).attempt());
}

}  // namespace
}  // namespace weft::coordinator
