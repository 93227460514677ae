#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/machine_checks.h"
#include "cli/print_json.h"
#include "core/cache_folder.h"
#include "core/clock.h"
#include "core/error.h"
#include "security/tls_probe.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Check this machine, and say what to mend.\n"
    "Processor, memory, limits, disks and how fast they sync, the sandbox that reads files from "
    "strangers, devices that draw, ports, clock, certificate, and the coordinator. A note is "
    "worth knowing, a warning will be in the way some day, and what is broken makes the command "
    "exit with 1.\n"
    "Examples: weft doctor\n"
    "          weft doctor --coordinator hub.example:7411 --json";

using State = MachineCheck::State;

constexpr std::chrono::seconds kPatience{4};
constexpr std::uint16_t kCoordinatorPort = 7411;
constexpr std::uint16_t kNodePort = 7412;
constexpr double kClockLimitSeconds = 90;

struct DoctorOptions {
  security::Endpoint coordinator;
  bool wants_json = false;
};

// Workers are heard of every few seconds: their times are the coordinator's clock, nearly.
std::string clock_remark(const v1::ListWorkersResponse& response, core::Clock::Time now) {
  std::int64_t latest_ms = 0;
  for (const v1::Worker& worker : response.workers()) {
    latest_ms = std::max(latest_ms, worker.lost() ? 0 : worker.last_seen_at_ms());
  }
  const double ahead_seconds =
      static_cast<double>(latest_ms - now.time_since_epoch().count()) / 1000;
  return latest_ms == 0 || std::abs(ahead_seconds) < kClockLimitSeconds
             ? ""
             : fmt::format("its clock differs from ours by {:.0f} s", std::abs(ahead_seconds));
}

MachineCheck no_answer(const security::Endpoint& endpoint, const grpc::Status& status) {
  const std::string name = "coordinator";
  if (const std::string problem = security::tls_problem(endpoint); !problem.empty()) {
    return {name, State::kBroken, problem, "see 'weft certs --help'"};
  }
  if (endpoint.address == kDefaultCoordinator) {
    return {name, State::kNote, "none answers at " + endpoint.address,
            "'weft up' starts one on this machine; for another's, set coordinator in "
            "~/.config/weft/weft.toml"};
  }
  return {name, State::kBroken,
          fmt::format("none answers at {} ({})", endpoint.address, status.error_message()),
          "start it there, open the port between here and there, or correct the address"};
}

MachineCheck check_coordinator(const security::Endpoint& endpoint) {
  const std::string name = "coordinator";
  try {
    Client client(endpoint);
    grpc::ClientContext context;
    Client::set_deadline(context, kPatience);
    v1::ListWorkersResponse response;
    const grpc::Status status =
        client.workers().ListWorkers(&context, v1::ListWorkersRequest(), &response);
    if (Client::is_worth_repeating(status)) {
      return no_answer(endpoint, status);
    }
    client.check(status, "list the workers");
    const std::string remark = clock_remark(response, core::system_clock().now());
    const std::string found =
        fmt::format("answers at {}, {} workers", endpoint.address, response.workers_size());
    return remark.empty() ? MachineCheck{name, State::kGood, found, ""}
                          : MachineCheck{name, State::kWarning, found + "; " + remark,
                                         "synchronise both clocks, as with chrony"};
  } catch (const std::exception& error) {
    return {name, State::kBroken, error.what(), ""};
  }
}

std::vector<MachineCheck> look(const DoctorOptions& options) {
  const std::filesystem::path cache = core::cache_folder();
  const MachineCheck coordinator = check_coordinator(options.coordinator);
  const bool is_ours =
      coordinator.state == State::kGood && options.coordinator.address == kDefaultCoordinator;
  return {check_processor(),
          check_memory(),
          check_open_files(),
          check_disk("the cache", cache),
          check_disk("this folder", "."),
          check_sandbox(),
          check_devices(),
          check_clock(),
          check_certificate(options.coordinator, core::system_clock().now()),
          coordinator,
          check_port("a coordinator", kCoordinatorPort, is_ours),
          check_port("a render node", kNodePort, false)};
}

void print(const std::vector<MachineCheck>& checks) {
  std::size_t width = 0;
  for (const MachineCheck& check : checks) {
    width = std::max(width, check.name.size());
  }
  for (const MachineCheck& check : checks) {
    fmt::print("{:<8} {:<{}}  {}\n", to_string(check.state), check.name, width, check.found);
    if (!check.mend.empty()) {
      fmt::print("{:<8} {:<{}}  -> {}\n", "", "", width, check.mend);
    }
  }
}

void run(const DoctorOptions& options) {
  const std::vector<MachineCheck> checks = look(options);
  const auto broken = std::count_if(checks.begin(), checks.end(), [](const MachineCheck& check) {
    return check.state == State::kBroken;
  });
  if (options.wants_json) {
    nlohmann::json list = nlohmann::json::array();
    for (const MachineCheck& check : checks) {
      list.push_back({{"name", check.name},
                      {"state", to_string(check.state)},
                      {"found", check.found},
                      {"mend", check.mend}});
    }
    print_json({{"healthy", broken == 0}, {"checks", list}});
  } else {
    print(checks);
  }
  if (broken > 0) {
    throw core::Error(core::Code::kFailedPrecondition,
                      fmt::format("{} of {} checks found something broken", broken, checks.size()));
  }
}

}  // namespace

void add_doctor(CLI::App& app) {
  auto options = std::make_shared<DoctorOptions>();
  CLI::App* command = add_command(app, "doctor", kHelp);
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
