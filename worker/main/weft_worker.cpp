#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>

#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "core/cache_folder.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/program.h"
#include "proto/address.h"
#include "proto/limits.h"
#include "proto/names.h"
#include "security/channel.h"
#include "security/endpoint_options.h"
#include "security/grpc_setup.h"
#include "security/tls_folder.h"
#include "security/tls_probe.h"
#include "worker/lease_loop.h"

namespace {

constexpr unsigned kMiB = 1U << 20U;
constexpr int kLongestReconnectMs = 2000;

std::string host_name() {
  std::string name(256, '\0');
  if (gethostname(name.data(), name.size() - 1) != 0) {
    return "worker";
  }
  name.resize(name.find('\0'));
  return name;
}

// A machine's certificate is for workers of its name.
std::string default_name(const weft::security::Endpoint& coordinator) {
  if (coordinator.tls_folder.empty()) {
    return host_name().substr(0, weft::v1::kNameLimitBytes);
  }
  const weft::security::TlsFolder folder{coordinator.tls_folder};
  return weft::security::check_tls_folder(folder, weft::security::TlsUse::kCall,
                                          weft::core::system_clock().now())
      .name;
}

std::string default_scratch() {
  const std::filesystem::path cache = weft::core::cache_folder();
  return (cache.empty() ? std::filesystem::temp_directory_path() / "weft-worker" : cache / "worker")
      .string();
}

std::string mistake_in_label(const std::string& label) {
  return weft::v1::is_label(label)
             ? std::string()
             : "a label is 1 to 64 characters of A-Z, a-z, 0-9, _, ., = and -";
}

struct Flags {
  weft::security::Endpoint coordinator = "127.0.0.1:7411";
  std::string log_level = "info";
  std::uint64_t scratch_limit_mib = 4096;
  weft::worker::WorkerOptions worker;
};

void declare(CLI::App& app, Flags& flags) {
  flags.worker.threads = std::max(1U, std::thread::hardware_concurrency());
  flags.worker.scratch = default_scratch();
  flags.worker.memory_bytes = static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
                              static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  app.add_option("--coordinator", flags.coordinator.address, "Address: host:port or unix:/path")
      ->envname("WEFT_COORDINATOR")
      ->check(CLI::Validator(weft::v1::mistake_in_address, "", "address"))
      ->capture_default_str();
  weft::security::add_security_options(app, flags.coordinator);
  app.add_option("--name", flags.worker.name,
                 "Name for people, at most 128 characters. With --tls-folder the certificate's "
                 "name, or one that begins with it and / or -. Default: the certificate's name, "
                 "else the machine's")
      ->check([](const std::string& name) {
        return weft::v1::is_worker_name(name)
                   ? std::string()
                   : "the name must have 1 to 128 characters, none of them a control character";
      });
  app.add_option("--threads", flags.worker.threads, "Shards computed at the same time")
      ->check(CLI::Range(1U, weft::v1::kThreadsLimit))
      ->default_str("all the machine has");
  app.add_option("--scratch", flags.worker.scratch,
                 "Folder for inputs that are used again and results until they are acknowledged; "
                 "may be shared between workers")
      ->capture_default_str();
  app.add_option("--scratch-limit", flags.scratch_limit_mib,
                 "How much of inputs to keep there, in MiB")
      ->check(CLI::Range(std::uint64_t{16}, std::uint64_t{1} << 30U))
      ->capture_default_str();
  app.add_option("--label", flags.worker.labels,
                 "What jobs may ask for, as in gpu or room=12; may be repeated")
      ->check(CLI::Validator(mistake_in_label, "", "label"))
      ->expected(1, static_cast<int>(weft::v1::kLabelsLimit));
  app.add_option("--wall-limit", flags.worker.wall_limit_seconds,
                 "Ends by itself before it has run for so many seconds, and takes no task that is "
                 "not expected to end before; 0: none")
      ->check(CLI::Range(0.0, 1e8))
      ->capture_default_str();
  app.add_option("--exit-when-idle", flags.worker.idle_limit_seconds,
                 "Ends when it had nothing to do for so many seconds, as when it is drained; 0: "
                 "never")
      ->check(CLI::Range(0.0, 1e8))
      ->capture_default_str();
  weft::core::add_log_option(app, flags.log_level);
  app.footer(
      "Computes shards for a coordinator until it is told to end. SIGTERM or Ctrl-C: begins "
      "nothing\nmore, reports what is done and ends within ten seconds; a second one ends it at "
      "once. While the\ncoordinator is away the worker goes on with what it has and tries again.\n"
      "Results that the coordinator has not acknowledged stay in the scratch folder, and are\n"
      "reported by the next worker that is started on it.\n"
      "Exits with 0 when it was told to end, 4 when the coordinator refuses it, 1 when every "
      "thread\n"
      "hangs.\n"
      "Example: weft-worker --coordinator 127.0.0.1:7411 --threads 4");
}

void work(Flags flags) {
  weft::core::start_log(flags.log_level);
  weft::security::set_up_grpc(weft::security::GrpcSays::kToLog);
  weft::core::Interrupt interrupt;
  // A limit of file sizes (ulimit -f) is a full disk to us, which is said and waited for.
  std::signal(SIGXFSZ, SIG_IGN);
  flags.worker.coordinator = flags.coordinator.address;
  if (flags.worker.name.empty()) {
    flags.worker.name = default_name(flags.coordinator);
  }
  flags.worker.connection_problem = [endpoint = flags.coordinator] {
    return weft::security::tls_problem(endpoint);
  };
  flags.worker.end_process = [](int code) {
    spdlog::shutdown();
    std::_Exit(code);
  };
  flags.worker.scratch_limit_bytes = flags.scratch_limit_mib * kMiB;
  // The coordinator may be restarted at any time; gRPC's own waits grow to minutes.
  weft::worker::LeaseLoop loop(
      std::move(flags.worker),
      weft::security::open_channel(flags.coordinator, kLongestReconnectMs));
  loop.run([&] { return interrupt.requested(); });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"weft-worker computes shards of fabrics for a coordinator."};
  weft::core::set_program_name(app, "weft-worker");
  Flags flags;
  declare(app, flags);
  return weft::core::run_program(app, argc, argv, [&] {
    work(std::move(flags));
    return 0;
  });
}
