#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/present.h"
#include "cli/print_json.h"
#include "cli/table.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "List the workers and what they compute.\n"
    "Those that were heard of within the last ten minutes. "
    "LAST SEEN is UTC. FAILURES and SHARDS count since\n"
    "the worker joined.\n"
    "Example: weft workers --json";

struct WorkersOptions {
  security::Endpoint coordinator;
  bool wants_json = false;
};

std::string doing(const v1::Worker& worker) {
  std::string text;
  for (const v1::WorkerAttempt& attempt : worker.attempts()) {
    text += text.empty() ? "" : ", ";
    text += fmt::format("{} {} {}/{}", attempt.fabric(), attempt.stage(), attempt.shards_done(),
                        attempt.shards());
  }
  return text.empty() ? "-" : text;
}

void run(const WorkersOptions& options) {
  Client client(options.coordinator);
  const v1::ListWorkersResponse response =
      client.call(client.workers(), &v1::WorkersService::Stub::ListWorkers,
                  v1::ListWorkersRequest(), "list the workers");
  if (options.wants_json) {
    print_json(to_json_array(response.workers()));
    return;
  }
  Table table({"NAME", "ID", "CONDITION", "THREADS", "SHARDS", "FAILURES", "LAST SEEN", "DOING"});
  for (const v1::Worker& worker : response.workers()) {
    table.add({worker.name(), worker.id(), condition_text(worker), std::to_string(worker.threads()),
               std::to_string(worker.shards_done()), std::to_string(worker.failures()),
               time_text(worker.last_seen_at_ms()), doing(worker)});
  }
  fmt::print("{}", table.text());
}

}  // namespace

void add_workers(CLI::App& app) {
  auto options = std::make_shared<WorkersOptions>();
  CLI::App* command = add_command(app, "workers", kHelp);
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON array on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
