#include <csignal>
#include <cstdio>
#include <ctime>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/server.h"
#include "coordinator/versions/commit.h"
#include "core/clock.h"
#include "core/error.h"
#include "security/endpoint_options.h"
#include "security/grpc_log.h"

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

// Blocks SIGTERM and SIGINT in this thread and all that it starts; they are waited for.
sigset_t block_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

int serve(const Options& options) {
  const sigset_t signals = block_signals();
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
  app.name("weft-coordinator");
  app.add_option("--listen", options.listen.address,
                 "HOST:PORT (port 0: any free one) or unix:PATH; printed when ready")
      ->capture_default_str();
  app.add_option("--state", options.state,
                 "folder of everything that must not be lost; made when absent, used by one "
                 "coordinator at a time")
      ->required();
  weft::security::add_security_options(app, options.listen);
  app.add_option("--lease", options.lease_seconds,
                 "seconds of silence after which a worker's shards go to another")
      ->check(CLI::Range(2U, 3600U))
      ->capture_default_str();
  app.add_option("--log-level", options.log_level, "what is logged to stderr")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
  app.set_version_flag("--version", "weft-coordinator 0.1.0");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  spdlog::set_default_logger(spdlog::stderr_color_mt("coordinator"));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e %l %v");
  spdlog::set_level(spdlog::level::from_str(options.log_level));
  weft::security::log_what_grpc_says();
  try {
    return serve(options);
  } catch (const core::Error& error) {
    std::fprintf(stderr, "weft-coordinator: %s\n", error.what());
    switch (error.code()) {
      case core::Code::kPermissionDenied:
        return 4;
      case core::Code::kUnavailable:
        return 5;
      default:
        return 1;
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "weft-coordinator: internal error: %s\n", error.what());
    return 1;
  }
}
