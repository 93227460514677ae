#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/local_cluster.h"
#include "core/interrupt.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Start a coordinator, its page and workers on this machine, until Ctrl-C.\n"
    "Prints the address when all are ready. The state (journal, results, published versions) and\n"
    "the logs stay in the state folder: started again, it goes on with the jobs it had. A worker\n"
    "that ends unasked is started again. SIGTERM and Ctrl-C stop everything, workers first; work\n"
    "that is not finished is done again when the cluster is back.\n"
    "Exits with 1 when something does not start or the coordinator ends, 5 when the port is "
    "taken.\n"
    "Example: weft up --workers 2 --state ~/weft-state";

struct UpOptions {
  LocalClusterOptions cluster;
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

void run(const UpOptions& options) {
  core::Interrupt interrupt;
  LocalCluster cluster(options.cluster);
  cluster.start(interrupt);
  cluster.print(options.wants_json);
  cluster.watch(interrupt);
  fmt::print(stderr, "stopping\n");
}

}  // namespace

void add_up(CLI::App& app) {
  auto options = std::make_shared<UpOptions>();
  options->cluster.state = default_state();
  options->cluster.listen = kDefaultCoordinator;
  CLI::App* command = add_command(app, "up", kHelp);
  command->add_option("--workers", options->cluster.workers, "How many workers")
      ->check(CLI::Range(1U, 256U))
      ->capture_default_str();
  command
      ->add_option("--threads", options->cluster.threads,
                   "Threads of each worker; default: the cores shared out between them")
      ->check(CLI::Range(1U, 1024U));
  command
      ->add_option("--state", options->cluster.state, "Folder of everything that must not be lost")
      ->capture_default_str();
  command->add_option("--listen", options->cluster.listen, "Address; port 0 takes any free one")
      ->capture_default_str();
  command->add_option(
      "--http", options->cluster.http,
      "HOST:PORT of the status page, or off; default: 127.0.0.1:7413 if it is free");
  command->add_flag("--render", options->cluster.render,
                    "Also start a render node, which draws the page's swatches");
  command->add_flag("--json", options->wants_json,
                    "When ready, print address and process ids as one JSON value");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
