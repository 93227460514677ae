#include "cli/local_cluster.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "cli/client.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"

namespace weft::cli {

namespace {

constexpr double kStartSeconds = 30;
constexpr double kWorkerStopSeconds = 12;
constexpr double kCoordinatorStopSeconds = 10;
constexpr int kRestartLimit = 5;
// Whatever WEFT_TLS_FOLDER says of other clusters: this one is on this machine alone.
constexpr const char* kNoTls = "";
constexpr std::chrono::milliseconds kPoll{100};
constexpr const char* kReadyLine = "weft-coordinator ready at ";
constexpr const char* kPageLine = "weft-coordinator page at ";
constexpr double kPageSeconds = 2;  // its line follows the other one at once
constexpr const char* kRenderNode = "render";

std::string last_line(const std::filesystem::path& log) {
  std::string text;
  try {
    text = core::read_file(log);
  } catch (const core::Error&) {
    return "";
  }
  while (!text.empty() && text.back() == '\n') {
    text.pop_back();
  }
  const std::size_t begin = text.rfind('\n');
  return begin == std::string::npos ? text : text.substr(begin + 1);
}

void throw_if_interrupted(core::Interrupt& interrupt) {
  if (interrupt.requested()) {
    throw core::Error(core::Code::kCancelled, "stopped while starting");
  }
}

}  // namespace

LocalCluster::LocalCluster(LocalClusterOptions options) : options_(std::move(options)) {
  options_.state = std::filesystem::absolute(options_.state);
  if (options_.threads == 0) {
    options_.threads = std::max(1U, std::thread::hardware_concurrency() / options_.workers);
  }
  core::make_folder(options_.state / "logs", "name another with --state");
}

LocalCluster::~LocalCluster() { stop(); }

std::filesystem::path LocalCluster::log_of(const std::string& name) const {
  return options_.state / "logs" / (name + ".log");
}

void LocalCluster::start(core::Interrupt& interrupt) {
  start_coordinator(interrupt);
  for (unsigned i = 0; i < options_.workers; ++i) {
    workers_.push_back({fmt::format("worker-{}", i + 1), nullptr, 0});
    start_worker(workers_.back());
  }
  if (options_.render) {
    render_node_.emplace(Worker{kRenderNode, nullptr, 0});
    start_worker(*render_node_);
  }
  wait_for_workers(interrupt);
}

void LocalCluster::watch(core::Interrupt& interrupt) {
  while (!interrupt.requested()) {
    throw_if_coordinator_ended();
    for (Worker& worker : workers_) {
      restart_if_ended(worker);
    }
    if (render_node_) {
      restart_if_ended(*render_node_);
    }
    if (std::all_of(workers_.begin(), workers_.end(),
                    [](const Worker& worker) { return worker.process == nullptr; })) {
      throw core::Error(core::Code::kFailedPrecondition,
                        "no worker is left; the logs are in " + (options_.state / "logs").string());
    }
    std::this_thread::sleep_for(kPoll);
  }
}

void LocalCluster::print(bool wants_json) const {
  if (wants_json) {
    nlohmann::json workers = nlohmann::json::array();
    for (const Worker& worker : workers_) {
      workers.push_back({{"name", worker.name}, {"pid", worker.process->pid()}});
    }
    print_json({{"coordinator", address_},
                {"pid", coordinator_->pid()},
                {"workers", workers},
                {"threads_per_worker", options_.threads},
                {"page", page_.empty() ? nlohmann::json(nullptr) : nlohmann::json(page_)},
                {"state", options_.state.string()}});
  } else {
    fmt::print("coordinator  {}  pid {}\n", address_, coordinator_->pid());
    for (const Worker& worker : workers_) {
      fmt::print("{:<11}  {} threads  pid {}\n", worker.name, options_.threads,
                 worker.process->pid());
    }
    if (render_node_) {
      fmt::print("{:<11}  pid {}\n", render_node_->name, render_node_->process->pid());
    }
    fmt::print("state        {}\n", options_.state.string());
    if (!page_.empty()) {
      fmt::print("page         {}\n", page_);
    }
    fmt::print("ready: 'weft submit FABRIC --coordinator {}'; Ctrl-C stops all\n", address_);
  }
  std::fflush(stdout);
}

void LocalCluster::start_coordinator(core::Interrupt& interrupt) {
  std::vector<std::string> command{(program_folder() / "weft-coordinator").string(),
                                   "--listen",
                                   options_.listen,
                                   "--state",
                                   options_.state.string(),
                                   "--tls-folder",
                                   kNoTls};
  if (!options_.http.empty()) {
    command.insert(command.end(), {"--http", options_.http});
  }
  if (options_.render) {
    command.insert(command.end(), {"--render-node", render_address()});
  }
  coordinator_ = std::make_unique<ChildProcess>(command, log_of("coordinator"), true);
  const core::Stopwatch since_start;
  while (address_.empty()) {
    throw_if_interrupted(interrupt);
    const std::optional<std::string> line = coordinator_->read_line(0.1);
    if (line && line->rfind(kReadyLine, 0) == 0) {
      address_ = line->substr(std::string(kReadyLine).size());
    } else {
      throw_if_coordinator_ended();
    }
    if (since_start.seconds() > kStartSeconds) {
      throw core::Error(core::Code::kUnavailable,
                        "the coordinator is not ready after " + format_duration(kStartSeconds) +
                            "; its log is " + log_of("coordinator").string());
    }
  }
  const std::string line = coordinator_->read_line(kPageSeconds).value_or("");
  page_ = line.starts_with(kPageLine) ? line.substr(std::string(kPageLine).size()) : "";
}

void LocalCluster::throw_if_coordinator_ended() {
  const std::optional<int> code = coordinator_->exit_code();
  if (!code) {
    return;
  }
  constexpr int kPortTaken = 5;  // weft-coordinator's exit code for an address it cannot have
  throw core::Error(
      *code == kPortTaken ? core::Code::kUnavailable : core::Code::kFailedPrecondition,
      fmt::format("the coordinator ended with {}: {}{}; its log is {}", *code,
                  last_line(log_of("coordinator")),
                  *code == kPortTaken ? "; name another address with --listen" : "",
                  log_of("coordinator").string()));
}

void LocalCluster::throw_if_a_worker_ended() {
  for (Worker& worker : workers_) {
    if (const std::optional<int> code = worker.process->exit_code()) {
      throw core::Error(
          core::Code::kFailedPrecondition,
          fmt::format("{} ended with {}: {}", worker.name, *code, last_line(log_of(worker.name))));
    }
  }
}

std::string LocalCluster::render_address() const {
  return "unix:" + (options_.state / "render.socket").string();
}

std::vector<std::string> LocalCluster::command_of(const Worker& worker) const {
  if (worker.name == kRenderNode) {
    return {(program_folder() / "weft-render").string(),
            "--coordinator",
            address_,
            "--listen",
            render_address(),
            "--tls-folder",
            kNoTls};
  }
  return {(program_folder() / "weft-worker").string(),
          "--coordinator",
          address_,
          "--name",
          worker.name,
          "--threads",
          std::to_string(options_.threads),
          "--scratch",
          (options_.state / "scratch").string(),
          "--tls-folder",
          kNoTls};
}

void LocalCluster::start_worker(Worker& worker) const {
  worker.process = std::make_unique<ChildProcess>(command_of(worker), log_of(worker.name), false);
}

void LocalCluster::restart_if_ended(Worker& worker) const {
  if (worker.process == nullptr) {
    return;
  }
  const std::optional<int> code = worker.process->exit_code();
  if (!code) {
    return;
  }
  const bool is_given_up = ++worker.restarts > kRestartLimit;
  fmt::print(stderr, "{} ended with {}: {}; {}\n", worker.name, *code,
             last_line(log_of(worker.name)),
             is_given_up ? "it is not started again" : "it is started again");
  if (is_given_up) {
    worker.process.reset();
  } else {
    start_worker(worker);
  }
}

void LocalCluster::wait_for_workers(core::Interrupt& interrupt) {
  Client client(address_);
  const core::Stopwatch since_start;
  while (true) {
    throw_if_coordinator_ended();
    throw_if_a_worker_ended();
    throw_if_interrupted(interrupt);
    const v1::ListWorkersResponse response =
        client.call(client.workers(), &v1::WorkersService::Stub::ListWorkers,
                    v1::ListWorkersRequest(), "list the workers");
    const auto ready = std::count_if(response.workers().begin(), response.workers().end(),
                                     [](const v1::Worker& worker) { return !worker.lost(); });
    if (static_cast<std::size_t>(ready) >= workers_.size()) {
      return;
    }
    if (since_start.seconds() > kStartSeconds) {
      throw core::Error(core::Code::kUnavailable,
                        "the workers are not ready after " + format_duration(kStartSeconds) +
                            "; their logs are in " + (options_.state / "logs").string());
    }
    std::this_thread::sleep_for(kPoll);
  }
}

void LocalCluster::stop() {
  for (const Worker& worker : workers_) {
    if (worker.process != nullptr) {
      worker.process->signal(SIGTERM);
    }
  }
  const core::Stopwatch since_start;
  for (const Worker& worker : workers_) {
    if (worker.process != nullptr) {
      (void)worker.process->wait(std::max(0.0, kWorkerStopSeconds - since_start.seconds()));
    }
  }
  workers_.clear();  // kills what is left
  render_node_.reset();
  if (coordinator_ != nullptr) {
    coordinator_->signal(SIGTERM);
    (void)coordinator_->wait(kCoordinatorStopSeconds);
    coordinator_.reset();
  }
}

}  // namespace weft::cli
