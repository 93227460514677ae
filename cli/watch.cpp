#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/follow_job.h"
#include "cli/present.h"
#include "cli/print_json.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Show a job's progress until it has ended.\n"
    "Per stage: the shards done, shards per second and the time left. Ctrl-C ends the watching,\n"
    "not the job, and says how to come back; a second one within three seconds cancels the job.\n"
    "Exits with 1 when the job failed, was cancelled, or is no longer watched.\n"
    "Example: weft watch j4f1c02a9d3be";

struct WatchOptions {
  security::Endpoint coordinator;
  std::string job;
  bool wants_json = false;
};

void run(const WatchOptions& options) {
  Interruption interruption(kFollowInterrupts);
  Client client(options.coordinator);
  const v1::Job job = follow_job(client, options.job, interruption);
  if (options.wants_json) {
    print_json(to_json(job));
  }
  throw_unless_succeeded(job);
  if (!options.wants_json) {
    fmt::print("{} succeeded: {}\n", job.id(), reference_text(job.version()));
  }
}

}  // namespace

void add_watch(CLI::App& app) {
  auto options = std::make_shared<WatchOptions>();
  CLI::App* command = add_command(app, "watch", kHelp);
  command->add_option("job", options->job, "Id of the job, or an unambiguous beginning of it")
      ->required();
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json,
                    "Print the ended job as one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
