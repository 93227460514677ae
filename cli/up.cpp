#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/child_process.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/present.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/file.h"
#include "core/interrupt.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Start a coordinator and workers on this machine, until Ctrl-C.\n"
    "Prints the address when all are ready. The state (journal, results, published versions) and\n"
    "the logs stay in the state folder: started again, it goes on with the jobs it had. A worker\n"
    "that ends unasked is started again. SIGTERM and Ctrl-C stop everything, workers first; work\n"
    "that is not finished is done again when the cluster is back.\n"
    "Exits with 1 when something does not start or the coordinator ends, 5 when the port is "
    "taken.\n"
    "Example: weft up --workers 2 --state ~/weft-state";

constexpr double kStartSeconds = 30;
constexpr double kWorkerStopSeconds = 12;
constexpr double kCoordinatorStopSeconds = 10;
constexpr int kRestartLimit = 5;
constexpr std::chrono::milliseconds kPoll{100};
constexpr const char* kReadyLine = "weft-coordinator ready at ";

struct UpOptions {
  unsigned workers = 1;
  unsigned threads = 0;
  std::string state;
  std::string listen = kDefaultCoordinator;
  bool wants_json = false;
};

std::string default_state() {
  // No other thread changes the environment: weft never does.
  const char* data = std::getenv("XDG_DATA_HOME");  // NOLINT(concurrency-mt-unsafe)
  if (data != nullptr && *data == '/') {
    return std::string(data) + "/weft";
  }
  const char* home = std::getenv("HOME");  // NOLINT(concurrency-mt-unsafe)
  return home != nullptr && *home != '\0' ? std::string(home) + "/.local/share/weft" : "weft-state";
}

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

// The processes of one local cluster; stopped in the right order when it goes.
class LocalCluster {
 public:
  explicit LocalCluster(const UpOptions& options)
      : options_(options),
        state_(std::filesystem::absolute(options.state)),
        threads_(options.threads > 0
                     ? options.threads
                     : std::max(1U, std::thread::hardware_concurrency() / options.workers)) {
    std::error_code failure;
    std::filesystem::create_directories(state_ / "logs", failure);
    if (failure) {
      throw core::Error(core::Code::kUnavailable, "cannot make the folder " + state_.string() +
                                                      ": " + failure.message() +
                                                      "; name another with --state");
    }
  }
  ~LocalCluster() { stop(); }
  LocalCluster(const LocalCluster&) = delete;
  LocalCluster& operator=(const LocalCluster&) = delete;
  LocalCluster(LocalCluster&&) = delete;
  LocalCluster& operator=(LocalCluster&&) = delete;

  // Returns when the coordinator and all workers are ready.
  void start(core::Interrupt& interrupt) {
    start_coordinator(interrupt);
    for (unsigned i = 0; i < options_.workers; ++i) {
      workers_.push_back({fmt::format("worker-{}", i + 1), nullptr, 0});
      start_worker(workers_.back());
    }
    wait_for_workers(interrupt);
  }

  // Returns when it is to be stopped. Throws when the coordinator ends, or the last worker.
  void watch(core::Interrupt& interrupt) {
    while (!interrupt.requested()) {
      throw_if_coordinator_ended();
      for (Worker& worker : workers_) {
        restart_if_ended(worker);
      }
      if (std::all_of(workers_.begin(), workers_.end(),
                      [](const Worker& worker) { return worker.process == nullptr; })) {
        throw core::Error(core::Code::kFailedPrecondition,
                          "no worker is left; the logs are in " + (state_ / "logs").string());
      }
      std::this_thread::sleep_for(kPoll);
    }
  }

  void print(bool wants_json) const {
    if (wants_json) {
      nlohmann::json workers = nlohmann::json::array();
      for (const Worker& worker : workers_) {
        workers.push_back({{"name", worker.name}, {"pid", worker.process->pid()}});
      }
      print_json({{"coordinator", address_},
                  {"pid", coordinator_->pid()},
                  {"workers", workers},
                  {"threads_per_worker", threads_},
                  {"state", state_.string()}});
    } else {
      fmt::print("coordinator  {}  pid {}\n", address_, coordinator_->pid());
      for (const Worker& worker : workers_) {
        fmt::print("{:<11}  {} threads  pid {}\n", worker.name, threads_, worker.process->pid());
      }
      fmt::print("state        {}\n", state_.string());
      fmt::print("ready: 'weft submit FABRIC --coordinator {}'; Ctrl-C stops all\n", address_);
    }
    std::fflush(stdout);
  }

 private:
  struct Worker {
    std::string name;
    std::unique_ptr<ChildProcess> process;  // null when it was given up
    int restarts = 0;
  };

  [[nodiscard]] std::filesystem::path log_of(const std::string& name) const {
    return state_ / "logs" / (name + ".log");
  }

  void start_coordinator(core::Interrupt& interrupt) {
    coordinator_ = std::make_unique<ChildProcess>(
        std::vector<std::string>{(program_folder() / "weft-coordinator").string(), "--listen",
                                 options_.listen, "--state", state_.string()},
        log_of("coordinator"), true);
    const core::Stopwatch since_start;
    while (address_.empty()) {
      if (interrupt.requested()) {
        throw core::Error(core::Code::kCancelled, "stopped while starting");
      }
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
  }

  void throw_if_coordinator_ended() {
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

  void start_worker(Worker& worker) const {
    worker.process = std::make_unique<ChildProcess>(
        std::vector<std::string>{(program_folder() / "weft-worker").string(), "--coordinator",
                                 address_, "--name", worker.name, "--threads",
                                 std::to_string(threads_), "--scratch",
                                 (state_ / "scratch").string()},
        log_of(worker.name), false);
  }

  void restart_if_ended(Worker& worker) const {
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

  void wait_for_workers(core::Interrupt& interrupt) {
    Client client(address_);
    const core::Stopwatch since_start;
    while (true) {
      throw_if_coordinator_ended();
      for (Worker& worker : workers_) {
        if (const std::optional<int> code = worker.process->exit_code()) {
          throw core::Error(core::Code::kFailedPrecondition,
                            fmt::format("{} ended with {}: {}", worker.name, *code,
                                        last_line(log_of(worker.name))));
        }
      }
      const v1::ListWorkersResponse response =
          client.call(client.workers(), &v1::WorkersService::Stub::ListWorkers,
                      v1::ListWorkersRequest(), "list the workers");
      const auto ready = std::count_if(response.workers().begin(), response.workers().end(),
                                       [](const v1::Worker& worker) { return !worker.lost(); });
      if (static_cast<std::size_t>(ready) >= workers_.size()) {
        return;
      }
      if (interrupt.requested()) {
        throw core::Error(core::Code::kCancelled, "stopped while starting");
      }
      if (since_start.seconds() > kStartSeconds) {
        throw core::Error(core::Code::kUnavailable,
                          "the workers are not ready after " + format_duration(kStartSeconds) +
                              "; their logs are in " + (state_ / "logs").string());
      }
      std::this_thread::sleep_for(kPoll);
    }
  }

  // Workers first, so that they can report what they have finished.
  void stop() {
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
    if (coordinator_ != nullptr) {
      coordinator_->signal(SIGTERM);
      (void)coordinator_->wait(kCoordinatorStopSeconds);
      coordinator_.reset();
    }
  }

  const UpOptions& options_;
  std::filesystem::path state_;
  unsigned threads_;
  std::string address_;
  std::unique_ptr<ChildProcess> coordinator_;
  std::vector<Worker> workers_;
};

void run(const UpOptions& options) {
  core::Interrupt interrupt;
  LocalCluster cluster(options);
  cluster.start(interrupt);
  cluster.print(options.wants_json);
  cluster.watch(interrupt);
  fmt::print(stderr, "stopping\n");
}

}  // namespace

void add_up(CLI::App& app) {
  auto options = std::make_shared<UpOptions>();
  options->state = default_state();
  CLI::App* command = add_command(app, "up", kHelp);
  command->add_option("--workers", options->workers, "How many workers")
      ->check(CLI::Range(1U, 256U))
      ->capture_default_str();
  command
      ->add_option("--threads", options->threads,
                   "Threads of each worker; default: the cores shared out between them")
      ->check(CLI::Range(1U, 1024U));
  command->add_option("--state", options->state, "Folder of everything that must not be lost")
      ->capture_default_str();
  command->add_option("--listen", options->listen, "Address; port 0 takes any free one")
      ->capture_default_str();
  command->add_flag("--json", options->wants_json,
                    "When ready, print address and process ids as one JSON value");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
