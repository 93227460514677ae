#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/present.h"
#include "cli/print_json.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "End a job.\n"
    "What it has computed stays with the coordinator and serves later jobs.\n"
    "A job that has ended already is left as it is.\n"
    "Example: weft cancel j4f1c02a9d3be";

struct CancelOptions {
  std::string coordinator;
  std::string job;
  bool wants_json = false;
};

void run(const CancelOptions& options) {
  Client client(options.coordinator);
  v1::CancelJobRequest request;
  request.set_request_id(new_request_id());
  request.set_job_id(options.job);
  const v1::CancelJobResponse response = client.call_repeatedly(
      client.jobs(), &v1::JobService::Stub::CancelJob, request, "cancel " + options.job);
  if (options.wants_json) {
    print_json(to_json(response.job()));
    return;
  }
  fmt::print("{} ({}) is {}\n", response.job().id(), response.job().fabric(),
             state_text(response.job().state()));
}

}  // namespace

void add_cancel(CLI::App& app) {
  auto options = std::make_shared<CancelOptions>();
  CLI::App* command = add_command(app, "cancel", kHelp);
  command->add_option("job", options->job, "Id of the job, or an unambiguous beginning of it")
      ->required();
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print the job as one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
