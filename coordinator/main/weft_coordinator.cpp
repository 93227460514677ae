#include <csignal>
#include <cstdio>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/server.h"
#include "coordinator/versions/commit.h"
#include "coordinator/web/metrics.h"
#include "coordinator/web/page.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/program.h"
#include "proto/address.h"
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
  std::string http;  // empty: nobody said
  std::vector<std::string> http_hosts;
  std::string render_node;
};

constexpr const char* kPageAddress = "127.0.0.1:7413";
constexpr const char* kNoPage = "off";

// The page where it was asked for. Where nobody asked it is on this machine alone, and only if its
// port is free; not beside TLS, because there whoever looks shall show who he is.
std::unique_ptr<coordinator::Page> open_page(const Options& options,
                                             coordinator::Scheduler& scheduler,
                                             coordinator::Metrics& metrics) {
  const bool is_asked_for = !options.http.empty();
  if (options.http == kNoPage || (!is_asked_for && !options.listen.tls_folder.empty())) {
    spdlog::info("event=no_page message=\"--http {}\"", is_asked_for ? kNoPage : "is not given");
    return nullptr;
  }
  coordinator::PageOptions page;
  page.listen.address = is_asked_for                             ? options.http
                        : options.listen.address.ends_with(":0") ? "127.0.0.1:0"
                                                                 : kPageAddress;
  if (!weft::v1::is_local_address(page.listen.address)) {
    page.listen.tls_folder = options.listen.tls_folder;
    page.listen.insecure = options.listen.insecure;
  }
  page.hosts = options.http_hosts;
  page.render_node = options.listen;
  page.render_node.address = options.render_node;
  page.state_folder = options.state;
  try {
    return std::make_unique<coordinator::Page>(scheduler, metrics, page);
  } catch (const core::Error& error) {
    if (is_asked_for || error.code() != core::Code::kUnavailable) {
      throw;
    }
    spdlog::warn("event=no_page message=\"{}\"", error.what());
    return nullptr;
  }
}

int serve(const Options& options) {
  if (options.state.empty()) {
    throw CLI::RequiredError("--state");
  }
  core::start_log(options.log_level);
  security::set_up_grpc(weft::security::GrpcSays::kToLog);
  const sigset_t signals = core::block_interrupts();
  // A limit of file sizes (ulimit -f) is a full disk to us, which is said before the process ends.
  std::signal(SIGXFSZ, SIG_IGN);
  coordinator::SchedulerOptions scheduler_options;
  scheduler_options.state_folder = options.state;
  scheduler_options.queue.lease_ms = options.lease_seconds * 1000;
  scheduler_options.commit = coordinator::commit;
  coordinator::Metrics metrics;
  scheduler_options.hooks = metrics.hooks();
  coordinator::Scheduler scheduler(std::move(scheduler_options), core::system_clock());
  coordinator::Server server(scheduler, options.listen);
  const std::unique_ptr<coordinator::Page> page = open_page(options, scheduler, metrics);
  std::printf("weft-coordinator ready at %s\n", server.address().c_str());
  if (page != nullptr) {
    std::printf("weft-coordinator page at %s\n", page->url().c_str());
  } else {
    std::printf("weft-coordinator has no page\n");
  }
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
                 "coordinator at a time; required");
  security::add_security_options(app, options.listen);
  app.add_option("--lease", options.lease_seconds,
                 "seconds of silence after which a worker's shards go to another")
      ->check(CLI::Range(2U, 3600U))
      ->capture_default_str();
  app.add_option("--http", options.http,
                 "HOST:PORT of the status page, or off; default: 127.0.0.1:7413 if it is free, and "
                 "off with --tls-folder. Other machines need a certificate to see it")
      ->option_text("HOST:PORT");
  app.add_option("--http-host", options.http_hosts,
                 "further name by which browsers may call the page; may be repeated")
      ->option_text("NAME");
  app.add_option("--render-node", options.render_node,
                 "HOST:PORT or unix:PATH of a weft-render that draws the page's swatches")
      ->option_text("ADDRESS");
  core::add_log_option(app, options.log_level);
  app.footer(
      "SIGTERM or Ctrl-C ends it; started again on the same state it goes on with its jobs, and "
      "takes its workers back with what they compute.\n"
      "Example: weft-coordinator --state /var/lib/weft --listen 127.0.0.1:7411");
  return core::run_program(app, argc, argv, [&] { return serve(options); });
}
