#include <csignal>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "core/cache_folder.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/program.h"
#include "proto/address.h"
#include "render/node/render_node.h"
#include "security/endpoint_options.h"
#include "security/grpc_setup.h"

namespace {

namespace core = weft::core;
namespace render = weft::render;
namespace security = weft::security;

struct Options {
  render::RenderNodeOptions node;
  security::Endpoint listen = "127.0.0.1:7412";
  std::string log_level = "info";
  double cache_gib = 16;
  double memory_gib = 0;
  double drain_seconds = 60;
};

constexpr double kGib = 1024.0 * 1024 * 1024;

// Three quarters of the machine's.
double default_memory_gib() {
  const auto pages = static_cast<double>(sysconf(_SC_PHYS_PAGES));
  return 0.75 * pages * static_cast<double>(sysconf(_SC_PAGE_SIZE)) / kGib;
}

int serve(Options options) {
  core::start_log(options.log_level);
  security::set_up_grpc(weft::security::GrpcSays::kToLog);
  const sigset_t signals = core::block_interrupts();
  options.node.cache_limit_bytes = static_cast<std::uint64_t>(options.cache_gib * kGib);
  options.node.memory_limit_bytes = static_cast<std::uint64_t>(options.memory_gib * kGib);
  options.node.coordinator.tls_folder = options.listen.tls_folder;
  options.node.coordinator.insecure = options.listen.insecure;
  render::RenderNode node(options.node, options.listen);
  std::printf("weft-render ready at %s\n", node.address().c_str());
  std::fflush(stdout);
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("event=draining signal={}", signal);
  const core::Stopwatch since_signal;
  node.drain([&] {
    const timespec at_once{};
    return since_signal.seconds() > options.drain_seconds ||
           sigtimedwait(&signals, nullptr, &at_once) > 0;
  });
  spdlog::info("event=stopping");
  return 0;
}

void add_options(CLI::App& app, Options& options) {
  app.add_option("--listen", options.listen.address,
                 "HOST:PORT (port 0: any free one) or unix:PATH; printed when ready")
      ->capture_default_str();
  security::add_security_options(app, options.listen);
  app.add_option("--coordinator", options.node.coordinator.address,
                 "where fabrics come from: host:port or unix:/path")
      ->envname("WEFT_COORDINATOR")
      ->check(CLI::Validator(weft::v1::mistake_in_address, "", "address"))
      ->capture_default_str();
  app.add_option("--cache", options.node.cache, "folder of fetched fabrics; made when absent")
      ->capture_default_str();
  app.add_option("--cache-limit", options.cache_gib,
                 "GiB of fetched fabrics; those used longest ago go first")
      ->check(CLI::Range(0.001, 1e6))
      ->capture_default_str();
  app.add_option("--memory-limit", options.memory_gib,
                 "GiB of fabrics and pictures in memory; what does not fit is refused")
      ->check(CLI::Range(0.001, 1e6))
      ->default_str("three quarters of the machine's");
  app.add_option("--orders", options.node.orders_limit, "orders being drawn and waiting, at most")
      ->check(CLI::Range(1U, 64U))
      ->capture_default_str();
  app.add_option("--device", options.node.device,
                 "what draws the precomputed integrator: auto (a GPU, else the CPU), "
                 "cpu, or an index or name of 'weft render --list-devices'")
      ->capture_default_str();
  app.add_option("--threads", options.node.threads, "threads; default: all the machine has")
      ->check(CLI::Range(1U, 1024U));
  app.add_option("--drain", options.drain_seconds,
                 "seconds that orders get to finish after SIGTERM")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  core::add_log_option(app, options.log_level);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  options.node.coordinator = "127.0.0.1:7411";
  const std::filesystem::path cache = core::cache_folder();
  options.node.cache = cache.empty() ? "weft-cache" : cache.string();
  options.memory_gib = default_memory_gib();
  CLI::App app{
      "weft-render draws scenes for 'weft render --node' and others: it fetches the fabrics that "
      "they name from a coordinator and keeps them between pictures."};
  core::set_program_name(app, "weft-render");
  add_options(app, options);
  app.footer(
      "SIGTERM: takes no more orders, finishes those it has and ends; a second one ends it at "
      "once.\n"
      "Example: weft-render --coordinator hub.example:7411 --tls-folder render-07");
  return core::run_program(app, argc, argv, [&] { return serve(options); });
}
