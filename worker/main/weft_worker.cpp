#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "core/error.h"
#include "core/interrupt.h"
#include "proto/address.h"
#include "proto/limits.h"
#include "worker/lease_loop.h"

namespace {

constexpr unsigned kMiB = 1U << 20U;

std::string host_name() {
  std::string name(256, '\0');
  if (gethostname(name.data(), name.size() - 1) != 0) {
    return "worker";
  }
  name.resize(name.find('\0'));
  return name;
}

std::string default_scratch() {
  // No other thread runs yet.
  const char* cache = std::getenv("XDG_CACHE_HOME");  // NOLINT(concurrency-mt-unsafe)
  if (cache != nullptr && *cache == '/') {
    return std::string(cache) + "/weft/worker";
  }
  const char* home = std::getenv("HOME");  // NOLINT(concurrency-mt-unsafe)
  return home != nullptr && *home != '\0'
             ? std::string(home) + "/.cache/weft/worker"
             : (std::filesystem::temp_directory_path() / "weft-worker").string();
}

struct Flags {
  std::string coordinator = "127.0.0.1:7411";
  std::string log_level = "info";
  std::uint64_t scratch_limit_mib = 4096;
  weft::worker::WorkerOptions worker;
};

void declare(CLI::App& app, Flags& flags) {
  flags.worker.name = host_name().substr(0, weft::v1::kNameLimitBytes);
  flags.worker.threads = std::max(1U, std::thread::hardware_concurrency());
  flags.worker.scratch = default_scratch();
  flags.worker.memory_bytes = static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
                              static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  app.add_option("--coordinator", flags.coordinator, "Address: host:port or unix:/path")
      ->envname("WEFT_COORDINATOR")
      ->check(CLI::Validator(weft::v1::mistake_in_address, "", "address"))
      ->capture_default_str();
  app.add_option("--name", flags.worker.name, "Name for people, at most 128 characters")
      ->check([](const std::string& name) {
        return !name.empty() && name.size() <= weft::v1::kNameLimitBytes
                   ? std::string()
                   : "the name must have 1 to 128 characters";
      })
      ->capture_default_str();
  app.add_option("--threads", flags.worker.threads, "Shards computed at the same time")
      ->check(CLI::Range(1U, weft::v1::kThreadsLimit))
      ->capture_default_str();
  app.add_option("--scratch", flags.worker.scratch,
                 "Folder for inputs that are used again; may be shared between workers")
      ->capture_default_str();
  app.add_option("--scratch-limit", flags.scratch_limit_mib, "How much to keep there, in MiB")
      ->check(CLI::Range(std::uint64_t{16}, std::uint64_t{1} << 30U))
      ->capture_default_str();
  app.add_option("--log-level", flags.log_level, "error, warn, info or debug")
      ->check(CLI::IsMember({"error", "warn", "info", "debug"}))
      ->capture_default_str();
  app.footer(
      "Computes shards for a coordinator until it is told to end. SIGTERM or Ctrl-C: begins "
      "nothing\nmore, reports what is done and ends within ten seconds; a second one ends it at "
      "once. While the\ncoordinator is away the worker goes on with what it has and tries again.\n"
      "Exits with 0 when it was told to end, 1 when the coordinator refuses it.\n"
      "Example: weft-worker --coordinator 127.0.0.1:7411 --threads 4");
}

void work(Flags flags) {
  const auto log = spdlog::stderr_logger_mt("weft-worker");
  log->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %l %v");
  spdlog::set_default_logger(log);
  spdlog::set_level(spdlog::level::from_str(flags.log_level));
  weft::core::Interrupt interrupt;  // before any thread is started
  flags.worker.scratch_limit_bytes = flags.scratch_limit_mib * kMiB;
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(weft::v1::kMessageLimitBytes);
  arguments.SetMaxSendMessageSize(weft::v1::kMessageLimitBytes);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  // The coordinator may be restarted at any time; gRPC's own waits grow to minutes.
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 200);
  weft::worker::LeaseLoop loop(
      std::move(flags.worker),
      grpc::CreateCustomChannel(flags.coordinator, grpc::InsecureChannelCredentials(), arguments));
  loop.run([&] { return interrupt.requested(); });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"weft-worker computes shards of fabrics for a coordinator."};
  app.name("weft-worker");
  app.set_version_flag("--version", "weft-worker 0.1.0");
  Flags flags;
  try {
    declare(app, flags);
    app.parse(argc, argv);
    work(std::move(flags));
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const weft::core::Error& error) {
    std::fprintf(stderr, "weft-worker: %s\n", error.what());
    return 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "weft-worker: internal error: %s\n", error.what());
    return 1;
  }
  return 0;
}
