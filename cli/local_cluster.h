#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/child_process.h"
#include "core/interrupt.h"

namespace weft::cli {

struct LocalClusterOptions {
  unsigned workers = 1;
  unsigned threads = 0;         // of each worker; 0: the cores shared out between them
  std::filesystem::path state;  // journal, results, versions, logs/, scratch/
  std::string listen;           // host:port, port 0 for any free one, or unix:/path
  std::string http;             // of the status page, as weft-coordinator takes it; empty: usual
  bool render = false;          // a render node besides, which draws the page's swatches
};

// A coordinator, workers and perhaps a render node on this machine, as children of this process.
// They are stopped, workers first so that they can report what they have finished, when the object
// goes; and end by themselves should this process be killed. Of one thread.
class LocalCluster {
 public:
  // Makes the state folder. Throws core::Error(kUnavailable) when it cannot.
  explicit LocalCluster(LocalClusterOptions options);
  ~LocalCluster();
  LocalCluster(const LocalCluster&) = delete;
  LocalCluster& operator=(const LocalCluster&) = delete;
  LocalCluster(LocalCluster&&) = delete;
  LocalCluster& operator=(LocalCluster&&) = delete;

  // Returns when the coordinator and all workers are ready. Throws core::Error: kUnavailable when
  // the address is taken or something is not ready in time, kFailedPrecondition when a process
  // ended, kCancelled when interrupted.
  void start(core::Interrupt& interrupt);

  // Starts workers that ended again, a few times each, until interrupted. Throws
  // core::Error(kFailedPrecondition) when the coordinator ends, or the last worker is given up.
  void watch(core::Interrupt& interrupt);

  // What was started, on stdout.
  void print(bool wants_json) const;

 private:
  // Or the render node, which is started again alike.
  struct Worker {
    std::string name;
    std::unique_ptr<ChildProcess> process;  // null when it was given up
    int restarts = 0;
  };

  [[nodiscard]] std::filesystem::path log_of(const std::string& name) const;
  void start_coordinator(core::Interrupt& interrupt);
  void start_worker(Worker& worker) const;
  [[nodiscard]] std::vector<std::string> command_of(const Worker& worker) const;
  [[nodiscard]] std::string render_address() const;
  void wait_for_workers(core::Interrupt& interrupt);
  void throw_if_coordinator_ended();
  void throw_if_a_worker_ended();
  void restart_if_ended(Worker& worker) const;
  void stop();

  LocalClusterOptions options_;
  std::string address_;
  std::string page_;  // its URL; empty: there is none
  std::unique_ptr<ChildProcess> coordinator_;
  std::vector<Worker> workers_;
  std::optional<Worker> render_node_;
};

}  // namespace weft::cli
