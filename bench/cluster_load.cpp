// bench_cluster_load: what a coordinator bears. Starts weft-coordinator on a folder of its own and
// talks to it over loopback as workers that compute nothing: durable tasks per second, latency of a
// dispatch, processor time and memory per task, a restart with many tasks queued, a thousand
// waiting workers, and how soon a lost one is noticed. Usage: bench_cluster_load BIN_DIR [TASKS]
// [WORKERS]
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <thread>

#include <unistd.h>

#include "bench/coordinator_process.h"
#include "bench/simulated_worker.h"
#include "core/clock.h"
#include "core/error.h"
#include "proto/status.h"
#include "tests/coordinator_fabric.h"

namespace weft::bench {
namespace {

constexpr std::uint32_t kPathsPerShard = 16'384;
constexpr std::uint32_t kCells = 1'000;
constexpr double kThroughputSeconds = 15;
constexpr double kWaitingSeconds = 20;
constexpr int kLatencySamples = 1'000;

std::string submit(const CoordinatorProcess& coordinator, const std::string& id,
                   std::uint64_t tasks) {
  const auto jobs = v1::JobService::NewStub(coordinator.connect());
  grpc::ClientContext context;
  v1::SubmitRequest request;
  request.set_request_id(id);
  *request.mutable_description() = coordinator::small_description(id);
  const std::uint64_t shards_per_cell = (tasks + kCells - 1) / kCells;
  request.mutable_description()->mutable_precompute()->set_paths_per_cell(
      static_cast<std::uint32_t>(shards_per_cell * kPathsPerShard));
  request.mutable_description()->set_seed(core::digest_of(id).bytes[0] + 1U);
  v1::SubmitResponse response;
  v1::throw_unless_ok(jobs->Submit(&context, request, &response), "submit");
  return response.job().id();
}

void cancel(const CoordinatorProcess& coordinator, const std::string& job) {
  const auto jobs = v1::JobService::NewStub(coordinator.connect());
  grpc::ClientContext context;
  v1::CancelJobRequest request;
  request.set_request_id("cancel-" + job);
  request.set_job_id(job);
  v1::CancelJobResponse response;
  v1::throw_unless_ok(jobs->CancelJob(&context, request, &response), "cancel");
}

// Works until shards of the stage of many tasks are given; those are held back.
void reach_transfer(SimulatedWorker& worker) {
  for (;;) {
    const v1::SynchronizeResponse response = worker.exchange();
    for (const v1::Assignment& assignment : response.assignments()) {
      if (assignment.stage() == "transfer") {
        return;
      }
    }
  }
}

void measure_throughput(const CoordinatorProcess& coordinator, const NoOpResults& results,
                        std::uint64_t work_ms, const char* what) {
  const std::string job = submit(coordinator, std::string("throughput-") + what, 900'000);
  std::vector<std::unique_ptr<SimulatedWorker>> workers;
  for (const char* id : {"a", "b"}) {
    workers.push_back(std::make_unique<SimulatedWorker>(coordinator.connect(),
                                                        std::string(what) + "-" + id, results));
    workers.back()->work_ms = work_ms;
    workers.back()->request().set_free_attempts(64);
  }
  reach_transfer(*workers[0]);
  workers[0]->acknowledged_shards = 0;
  const double cpu_before = coordinator.cpu_seconds();
  const core::Stopwatch watch;
  std::vector<std::thread> threads;
  for (const auto& worker : workers) {
    threads.emplace_back([&watch, w = worker.get()] {
      while (watch.seconds() < kThroughputSeconds) {
        (void)w->exchange();
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  const double seconds = watch.seconds();
  const auto tasks =
      static_cast<double>(workers[0]->acknowledged_shards + workers[1]->acknowledged_shards);
  const double cpu = coordinator.cpu_seconds() - cpu_before;
  std::printf("%s: %.0f durable tasks per second with 2 workers, %.1f us of the coordinator each\n",
              what, tasks / seconds, 1e6 * cpu / tasks);
  for (const auto& worker : workers) {
    worker->request().set_leaving(true);
    worker->request().set_free_attempts(0);
    (void)worker->exchange();
  }
  cancel(coordinator, job);
}

void measure_latency(const CoordinatorProcess& coordinator, const NoOpResults& results) {
  const std::string job = submit(coordinator, "latency", 400'000);
  SimulatedWorker worker(coordinator.connect(), "latency-worker", results);
  worker.work_ms = 20'000;
  reach_transfer(worker);
  std::vector<double> milliseconds;
  while (milliseconds.size() < kLatencySamples) {
    const core::Stopwatch watch;
    const v1::SynchronizeResponse response = worker.exchange();
    if (response.assignments_size() > 0 && response.acknowledged_size() > 0) {
      milliseconds.push_back(1e3 * watch.seconds());
    }
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  std::printf("dispatch: from a completion to the next assignment p50 %.2f ms, p99 %.2f ms\n",
              milliseconds[milliseconds.size() / 2], milliseconds[milliseconds.size() * 99 / 100]);
  worker.request().set_leaving(true);
  (void)worker.exchange();
  cancel(coordinator, job);
}

void measure_queued(CoordinatorProcess& coordinator, const NoOpResults& results,
                    std::uint64_t tasks) {
  const double before = coordinator.memory_bytes();
  const std::string job = submit(coordinator, "queued", tasks);
  {
    SimulatedWorker worker(coordinator.connect(), "queued-worker", results);
    reach_transfer(worker);
  }
  std::printf("queued: %.0f bytes of the coordinator for each of %lu tasks\n",
              (coordinator.memory_bytes() - before) / static_cast<double>(tasks), tasks);
  coordinator.kill();
  const core::Stopwatch watch;
  coordinator.start();
  const double ready = watch.seconds();
  SimulatedWorker worker(coordinator.connect(), "after-restart", results);
  reach_transfer(worker);
  std::printf("restart: answers after %.2f s, gives out one of %lu tasks after %.2f s\n", ready,
              tasks, watch.seconds());
  cancel(coordinator, job);
}

// A worker whose calls wait, one after another, on a connection of its own, without a thread.
class Waiter {
 public:
  Waiter(const CoordinatorProcess& coordinator, int number, const NoOpResults& results)
      : worker_(coordinator.connect(number), "waiter-" + std::to_string(number), results) {
    worker_.request().set_wait_ms(5'000);
  }
  void call() {
    worker_.count();
    context_ = std::make_unique<grpc::ClientContext>();
    worker_.stub().async()->Synchronize(context_.get(), &worker_.request(), &response_,
                                        [this](const grpc::Status& status) {
                                          ++(status.ok() ? answers : failures);
                                          if (!is_stopping) {
                                            call();
                                          } else {
                                            is_idle = true;
                                          }
                                        });
  }
  std::atomic<std::uint64_t> answers{0};
  std::atomic<std::uint64_t> failures{0};
  std::atomic<bool> is_stopping{false};
  std::atomic<bool> is_idle{false};

 private:
  SimulatedWorker worker_;
  std::unique_ptr<grpc::ClientContext> context_;
  v1::SynchronizeResponse response_;
};

void measure_waiting(const CoordinatorProcess& coordinator, const NoOpResults& results, int count) {
  const double threads_before = coordinator.threads();
  std::vector<std::unique_ptr<Waiter>> waiters;
  for (int i = 0; i < count; ++i) {
    waiters.push_back(std::make_unique<Waiter>(coordinator, i, results));
    waiters.back()->call();
  }
  std::this_thread::sleep_for(std::chrono::seconds(8));  // all are connected
  const auto answers = [&] {
    std::uint64_t sum = 0;
    for (const auto& waiter : waiters) {
      sum += waiter->answers;
    }
    return static_cast<double>(sum);
  };
  const double cpu_before = coordinator.cpu_seconds();
  const double answers_before = answers();
  const core::Stopwatch watch;
  std::this_thread::sleep_for(std::chrono::duration<double>(kWaitingSeconds));
  const double seconds = watch.seconds();
  std::printf(
      "waiting: %d workers, %.0f heartbeats per second, %.3f of a core, %.0f threads more\n", count,
      (answers() - answers_before) / seconds, (coordinator.cpu_seconds() - cpu_before) / seconds,
      coordinator.threads() - threads_before);
  for (const auto& waiter : waiters) {
    waiter->is_stopping = true;
  }
  for (const auto& waiter : waiters) {
    while (!waiter->is_idle) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
}

// How long until the attempt of a worker that went away is given up.
void measure_detection(const CoordinatorProcess& coordinator, const NoOpResults& results,
                       bool closes_connection) {
  const char* const what = closes_connection ? "closed" : "silent";
  const std::string job = submit(coordinator, std::string("detect-") + what, 1'000);
  auto worker = std::make_unique<SimulatedWorker>(coordinator.connect(),
                                                  std::string("detect-") + what, results);
  v1::SynchronizeResponse response;
  while (response.assignments_size() == 0) {
    response = worker->exchange();
  }
  worker->hold(response);
  core::Stopwatch watch;
  if (closes_connection) {
    worker->request().set_free_attempts(0);
    worker->request().set_wait_ms(30'000);
    worker->count();
    grpc::ClientContext context;
    std::atomic<bool> is_over{false};
    worker->stub().async()->Synchronize(&context, &worker->request(), &response,
                                        [&](const grpc::Status& /*status*/) { is_over = true; });
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    watch = core::Stopwatch();
    context.TryCancel();
    while (!is_over) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  worker.reset();
  const auto jobs = v1::JobService::NewStub(coordinator.connect());
  for (std::string outcome = "running"; outcome == "running";) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    grpc::ClientContext context;
    v1::ListAttemptsRequest request;
    request.set_job_id(job);
    v1::ListAttemptsResponse attempts;
    v1::throw_unless_ok(jobs->ListAttempts(&context, request, &attempts), "list attempts");
    outcome = attempts.attempts(0).outcome();
  }
  std::printf("detection: a worker that %s is noticed after %.1f s\n",
              closes_connection ? "closes its connection" : "falls silent", watch.seconds());
  cancel(coordinator, job);
}

void run(const std::filesystem::path& programs, std::uint64_t tasks, int workers) {
  std::string folder = (std::filesystem::temp_directory_path() / "weft_load_XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr) {
    throw core::Error(core::Code::kUnavailable, "no temporary folder");
  }
  const NoOpResults results(kCells);
  CoordinatorProcess coordinator(programs / "weft-coordinator",
                                 std::filesystem::path(folder) / "state");
  coordinator.start();
  measure_queued(coordinator, results, tasks);  // first, while its memory is as small as it gets
  measure_throughput(coordinator, results, 60'000, "single");
  measure_throughput(coordinator, results, 100, "runs");
  measure_latency(coordinator, results);
  measure_detection(coordinator, results, true);
  measure_waiting(coordinator, results, workers);
  measure_detection(coordinator, results, false);
  coordinator.kill();
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace weft::bench

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: bench_cluster_load BIN_DIR [TASKS] [WORKERS]\n";
    return 2;
  }
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  try {
    weft::bench::run(argv[1], argc > 2 ? std::stoull(argv[2]) : 1'000'000,
                     argc > 3 ? std::stoi(argv[3]) : 1'000);
  } catch (const std::exception& error) {
    std::cerr << "bench_cluster_load: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
