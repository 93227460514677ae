#pragma once

#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>

#include "core/clock.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "tests/cli_programs.h"

// A cluster of real processes of which each may be killed and started again, and what its journal
// and its workers' logs say in the end.

namespace weft::cli {

class FaultCluster {
 public:
  static constexpr double kReadySeconds = 60;

  FaultCluster(const std::filesystem::path& folder, std::size_t workers, std::string lease)
      : folder_(folder), lease_(std::move(lease)), workers_(workers) {
    std::filesystem::create_directories(folder_);
    start_coordinator();
  }

  // Starts it, or starts it again at the same address.
  void start_coordinator() {
    const std::string prefix = "weft-coordinator ready at ";
    const core::Stopwatch since_start;
    while (since_start.seconds() < kReadySeconds) {
      coordinator_ = std::make_unique<ChildProcess>(
          std::vector<std::string>{program("weft-coordinator"), "--listen",
                                   address_.empty() ? "127.0.0.1:0" : address_, "--state",
                                   path("state"), "--lease", lease_},
          path("coordinator.log"), true);
      const std::string line = coordinator_->read_line(kReadySeconds).value_or("");
      if (line.starts_with(prefix)) {
        address_ = line.substr(prefix.size());
        jobs_ = v1::JobService::NewStub(
            grpc::CreateChannel(address_, grpc::InsecureChannelCredentials()));
        return;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(200));  // the port may linger
    }
    ADD_FAILURE() << "the coordinator is not ready: " << core::read_file(path("coordinator.log"));
  }
  // At `address`, or at the coordinator itself. All workers share one scratch folder.
  void start_worker(std::size_t index, const std::string& address = "") {
    const std::string name = "worker-" + std::to_string(index);
    workers_.at(index) = std::make_unique<ChildProcess>(
        std::vector<std::string>{program("weft-worker"), "--coordinator",
                                 address.empty() ? address_ : address, "--name", name, "--threads",
                                 "1", "--log-level", "debug", "--scratch", path("scratch")},
        path(name + ".log"), false);
  }

  [[nodiscard]] const std::string& address() const { return address_; }
  [[nodiscard]] ChildProcess& coordinator() { return *coordinator_; }
  [[nodiscard]] ChildProcess& worker(std::size_t index) { return *workers_.at(index); }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_ / name).string();
  }
  [[nodiscard]] std::string worker_log(std::size_t index) const {
    return core::read_file(path("worker-" + std::to_string(index) + ".log"));
  }

  // The id of the job that `weft submit` made.
  std::string submit(const TestFolder& folder, const std::string& description) {
    const Finished submitted =
        run_weft(folder, {"submit", description, "--json", "--coordinator", address_});
    EXPECT_EQ(submitted.code, 0) << submitted.err;
    job_ = submitted.code == 0 ? submitted.json().at("id").get<std::string>() : "";
    return job_;
  }

  // Nothing while the coordinator does not answer.
  std::optional<v1::Job> job() {
    grpc::ClientContext context;
    set_deadline(context);
    v1::GetJobRequest request;
    request.set_job_id(job_);
    v1::GetJobResponse response;
    return jobs_->GetJob(&context, request, &response).ok() ? std::optional(response.job())
                                                            : std::nullopt;
  }
  std::vector<v1::AttemptInfo> attempts() {
    grpc::ClientContext context;
    set_deadline(context);
    v1::ListAttemptsRequest request;
    request.set_job_id(job_);
    v1::ListAttemptsResponse response;
    const grpc::Status status = jobs_->ListAttempts(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return {response.attempts().begin(), response.attempts().end()};
  }

  // Prints what is known of a run that went wrong.
  void tell_all() {
    for (const v1::AttemptInfo& attempt : attempts()) {
      std::printf("%s\n", attempt.ShortDebugString().c_str());
    }
    std::printf("%s", core::read_file(path("coordinator.log")).c_str());
    for (std::size_t i = 0; i < workers_.size(); ++i) {
      std::printf("worker-%zu:\n%s", i, worker_log(i).c_str());
    }
  }

  static std::uint64_t shards_done(const v1::Job& job) {
    std::uint64_t done = 0;
    for (const v1::StageProgress& stage : job.stages()) {
      done += stage.shards_done();
    }
    return done;
  }

  // Until `is_it` holds for the job, or it has ended, or a long time has passed; what it is then.
  template <class Predicate>
  v1::Job wait_until(Predicate&& is_it, double seconds = 200) {
    const core::Stopwatch since_start;
    v1::Job last;
    while (since_start.seconds() < seconds) {
      if (std::optional<v1::Job> now = job()) {
        last = *std::move(now);
        if (last.ended_at_ms() != 0 || is_it(last)) {
          return last;
        }
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
    }
    return last;
  }
  v1::Job wait_for_end() {
    return wait_until([](const v1::Job&) { return false; });
  }
  // Until the transfer stage, the longest, is under way.
  v1::Job wait_for_transfer() {
    return wait_until([](const v1::Job& job) {
      for (const v1::StageProgress& stage : job.stages()) {
        if (stage.name() == "transfer" && stage.shards_done() > 0) {
          return true;
        }
      }
      return false;
    });
  }

  // How often workers computed each shard: (stage, shard) -> times. Checks that each time belongs
  // to an attempt that the coordinator knows, whose worker it was and whose run holds the shard,
  // and that no attempt computed a shard twice.
  std::map<std::pair<std::string, std::uint64_t>, std::uint64_t> computed() {
    std::map<std::uint64_t, v1::AttemptInfo> known;
    for (const v1::AttemptInfo& attempt : attempts()) {
      known[attempt.name().attempt()] = attempt;
    }
    std::map<std::pair<std::string, std::uint64_t>, std::uint64_t> times;
    std::set<std::pair<std::uint64_t, std::uint64_t>> seen;
    for (std::size_t i = 0; i < workers_.size(); ++i) {
      std::istringstream lines(worker_log(i));
      for (std::string line; std::getline(lines, line);) {
        if (!line.ends_with("state=computed")) {
          continue;
        }
        const std::uint64_t id = number_after(line, "attempt=");
        const std::uint64_t shard = number_after(line, "shard=");
        EXPECT_TRUE(seen.emplace(id, shard).second) << "twice in one attempt: " << line;
        const auto attempt = known.find(id);
        if (attempt == known.end()) {
          ADD_FAILURE() << "no such attempt is recorded: " << line;
          continue;
        }
        const v1::AttemptInfo& info = attempt->second;
        EXPECT_EQ(info.worker(), "worker-" + std::to_string(i)) << line;
        EXPECT_TRUE(shard >= info.first_shard() && shard - info.first_shard() < info.shards())
            << line << "\n"
            << info.ShortDebugString();
        ++times[{info.stage(), shard}];
      }
    }
    return times;
  }

 private:
  static void set_deadline(grpc::ClientContext& context) {
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(5));
  }
  static std::uint64_t number_after(const std::string& line, const std::string& key) {
    const std::size_t at = line.find(" " + key);
    return at == std::string::npos ? 0 : std::stoull(line.substr(at + 1 + key.size()));
  }

  std::filesystem::path folder_;
  std::string lease_;
  std::string address_;
  std::string job_;
  std::unique_ptr<ChildProcess> coordinator_;
  std::vector<std::unique_ptr<ChildProcess>> workers_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

}  // namespace weft::cli
