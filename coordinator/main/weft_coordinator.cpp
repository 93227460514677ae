#include <csignal>
#include <cstdio>
#include <ctime>
#include <string>

#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/server.h"
#include "coordinator/versions/commit.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/program.h"
#include "security/endpoint_options.h"
#include "security/grpc_setup.h"

namespace {

namespace coordinator = weft::coordinator;
namespace core = weft::core;
namespace security = weft::security;

struct Options {
  security::Endpoint listen = "127.0.0.1:7411";
  std::string state;
  std::string log_level = "info";
  std::uint32_t lease_seconds = 30;
};

int serve(const Options& options) {
  core::start_log(options.log_level);
  security::set_up_grpc(weft::security::GrpcSays::kToLog);
  const sigset_t signals = core::block_interrupts();
  // A limit of file sizes (ulimit -f) is a full disk to us, which is said before the process ends.
  std::signal(SIGXFSZ, SIG_IGN);
  coordinator::SchedulerOptions scheduler_options;
  scheduler_options.state_folder = options.state;
  scheduler_options.queue.lease_ms = options.lease_seconds * 1000;
  scheduler_options.commit = coordinator::commit;
  coordinator::Scheduler scheduler(std::move(scheduler_options), core::system_clock());
  coordinator::Server server(scheduler, options.listen);
  std::printf("weft-coordinator ready at %s\n", server.address().c_str());
  std::fflush(stdout);

  for (;;) {
    const timespec wait{0, 500'000'000};
    const int signal = sigtimedwait(&signals, nullptr, &wait);
    if (signal > 0) {
      spdlog::info("event=stopping signal={}", signal);
      server.stop();
      return 0;
    }
    const std::optional<std::string> problem = scheduler.fatal_problem();
    if (problem) {
      spdlog::error("event=fatal message=\"{}\"", *problem);
      server.stop();
      return 1;
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{
      "weft-coordinator splits the precomputation of fabrics into tasks for weft-worker processes "
      "and keeps the versions of the databases that come of it."};
  core::set_program_name(app, "weft-coordinator");
  app.add_option("--listen", options.listen.address,
                 "HOST:PORT (port 0: any free one) or unix:PATH; printed when ready")
      ->capture_default_str();
  app.add_option("--state", options.state,
                 "folder of everything that must not be lost; made when absent, used by one "
                 "coordinator at a time")
      ->required();
  security::add_security_options(app, options.listen);
  app.add_option("--lease", options.lease_seconds,
                 "seconds of silence after which a worker's shards go to another")
      ->check(CLI::Range(2U, 3600U))
      ->capture_default_str();
  core::add_log_option(app, options.log_level);
  return core::run_program(app, argc, argv, [&] { return serve(options); });
}
