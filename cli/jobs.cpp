#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/present.h"
#include "cli/print_json.h"
#include "cli/table.h"
#include "proto/limits.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "List the coordinator's jobs, newest first.\n"
    "Times are UTC. SHARDS counts the units of work of the stages planned so far. 'weft explain "
    "job\n"
    "JOB' says why one waits.\n"
    "Example: weft jobs --unfinished";

struct JobsOptions {
  security::Endpoint coordinator;
  std::uint32_t limit = 20;
  bool is_unfinished_only = false;
  bool wants_json = false;
};

// What people want to know next: the version made, what went wrong, what is lacking.
std::string remark(const v1::Job& job) {
  std::string text = job.has_version()     ? reference_text(job.version())
                     : job.error().empty() ? job.waiting_for()
                                           : job.error();
  const std::string audits = audits_text(job);
  return text + (text.empty() || audits.empty() ? "" : "; ") + audits;
}

void run(const JobsOptions& options) {
  Client client(options.coordinator);
  v1::ListJobsRequest request;
  request.set_unfinished_only(options.is_unfinished_only);
  request.set_limit(options.limit);
  const v1::ListJobsResponse response =
      client.call(client.jobs(), &v1::JobService::Stub::ListJobs, request, "list the jobs");
  if (options.wants_json) {
    print_json(to_json_array(response.jobs()));
    return;
  }
  Table table({"JOB", "FABRIC", "USER", "PRIORITY", "STATE", "SHARDS", "SUBMITTED", "REMARK"});
  for (const v1::Job& job : response.jobs()) {
    table.add({job.id(), job.fabric(), job.user().empty() ? "-" : job.user(),
               std::to_string(job.priority()), job.paused() ? "paused" : state_text(job.state()),
               shards_text(job), time_text(job.submitted_at_ms()), remark(job)});
  }
  fmt::print("{}", table.text());
}

}  // namespace

void add_jobs(CLI::App& app) {
  auto options = std::make_shared<JobsOptions>();
  CLI::App* command = add_command(app, "jobs", kHelp);
  command->add_flag("--unfinished", options->is_unfinished_only,
                    "Only jobs that are queued or under way");
  command->add_option("--limit", options->limit, "How many jobs at most")
      ->check(CLI::Range(1U, v1::kListLimit))
      ->capture_default_str();
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON array on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
