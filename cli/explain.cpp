#include <charconv>
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
    "Say why a job, a task or a worker does what it does, or nothing.\n"
    "SUBJECT is a job's id, a task as STAGE/SHARD of a job (JOB/STAGE/SHARD), or a worker's name "
    "or\n"
    "id. Each reason has what can be done about it.\n"
    "Examples: weft explain job j4f1c02a9d3be\n"
    "          weft explain task j4f1c02a9d3be/transfer/17\n"
    "          weft explain worker render-07 --json";

struct ExplainOptions {
  security::Endpoint coordinator;
  std::string kind;
  std::string subject;
  bool wants_json = false;
};

v1::TaskName parse_task(const std::string& text) {
  const std::size_t first = text.find('/');
  const std::size_t second = first == std::string::npos ? first : text.find('/', first + 1);
  std::uint64_t shard = 0;
  bool is_number = false;
  if (second != std::string::npos) {
    const char* const end = text.data() + text.size();
    const auto parsed = std::from_chars(text.data() + second + 1, end, shard);
    is_number = parsed.ec == std::errc() && parsed.ptr == end;
  }
  if (!is_number) {
    throw CLI::ValidationError("subject", "'" + text +
                                              "' is not a task; write JOB/STAGE/SHARD, like "
                                              "j4f1c02a9d3be/transfer/17");
  }
  v1::TaskName task;
  task.set_job_id(text.substr(0, first));
  task.set_stage(text.substr(first + 1, second - first - 1));
  task.set_shard(shard);
  return task;
}

v1::ExplainRequest request_of(const ExplainOptions& options) {
  v1::ExplainRequest request;
  if (options.kind == "job") {
    request.set_job_id(options.subject);
  } else if (options.kind == "worker") {
    request.set_worker(options.subject);
  } else {
    *request.mutable_task() = parse_task(options.subject);
  }
  return request;
}

void print(const v1::Reason& reason) {
  std::string concern = reason.stage();
  if (!reason.worker().empty()) {
    concern += (concern.empty() ? "" : ", ") + reason.worker();
  }
  fmt::print("- {}{}\n", concern.empty() ? "" : concern + ": ", reason.text());
  if (reason.until_ms() > 0) {
    fmt::print("  until {} UTC\n", time_text(reason.until_ms()));
  }
  if (!reason.mend().empty()) {
    fmt::print("  {}\n", reason.mend());
  }
}

void run(const ExplainOptions& options) {
  const v1::ExplainRequest request = request_of(options);
  Client client(options.coordinator);
  const v1::ExplainResponse response = client.call(client.jobs(), &v1::JobService::Stub::Explain,
                                                   request, "explain " + options.subject);
  if (options.wants_json) {
    print_json(to_json(response));
    return;
  }
  fmt::print("{}: {}\n", response.subject(), response.verdict());
  for (const v1::Reason& reason : response.reasons()) {
    print(reason);
  }
}

}  // namespace

void add_explain(CLI::App& app) {
  auto options = std::make_shared<ExplainOptions>();
  CLI::App* command = add_command(app, "explain", kHelp);
  command->add_option("kind", options->kind, "job, task or worker")
      ->required()
      ->check(CLI::IsMember({"job", "task", "worker"}));
  command->add_option("subject", options->subject, "What to explain")->required();
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
