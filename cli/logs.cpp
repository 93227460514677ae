#include <charconv>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

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
    "Print what workers logged about a job.\n"
    "The logs of its attempts in the order in which these began, each under a line that names it.\n"
    "A log keeps its beginning and its end when it grows too long. With -f, lines are printed as\n"
    "they come until the job has ended; Ctrl-C ends the printing, not the job.\n"
    "Examples: weft logs j4f1c02a9d3be -f\n"
    "          weft logs j4f1c02a9d3be --task transfer/17\n"
    "          weft logs j4f1c02a9d3be --list";

// A stream that is not followed ends by itself; one that is followed is renewed by nobody, so that
// it may take as long as the job.
constexpr std::chrono::seconds kReadDeadline{120};
constexpr std::chrono::hours kFollowDeadline{24 * 30};

struct LogsOptions {
  security::Endpoint coordinator;
  std::string job;
  std::string task;
  std::uint64_t attempt = 0;
  bool is_followed = false;
  bool is_list = false;
  bool wants_json = false;
};

struct TaskFilter {
  std::string stage;
  std::optional<std::uint64_t> shard;
};

// "transfer" or "transfer/17".
TaskFilter parse_filter(const std::string& text) {
  const std::size_t slash = text.find('/');
  TaskFilter filter{text.substr(0, slash), {}};
  if (slash == std::string::npos) {
    return filter;
  }
  std::uint64_t shard = 0;
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data() + slash + 1, end, shard);
  if (parsed.ec != std::errc() || parsed.ptr != end) {
    throw CLI::ValidationError("--task", "'" + text +
                                             "' is not a task; write STAGE or "
                                             "STAGE/SHARD, like transfer/17");
  }
  filter.shard = shard;
  return filter;
}

template <class Request>
Request request_of(const LogsOptions& options) {
  const TaskFilter filter = parse_filter(options.task);
  Request request;
  request.set_job_id(options.job);
  request.set_stage(filter.stage);
  request.set_with_shard(filter.shard.has_value());
  request.set_shard(filter.shard.value_or(0));
  return request;
}

std::string shards_text(const v1::AttemptInfo& attempt) {
  const std::uint64_t last = attempt.first_shard() + attempt.shards() - 1;
  return attempt.shards() == 1 ? std::to_string(last)
                               : fmt::format("{}-{}", attempt.first_shard(), last);
}

// What is to be said of an attempt beside its outcome: that it was given up for a while, and why it
// failed or what it logged last.
std::string remark(const v1::AttemptInfo& attempt) {
  const std::string last = attempt.message().empty() ? attempt.last_line() : attempt.message();
  if (attempt.taken_up() == 0) {
    return last;
  }
  const std::string times =
      attempt.taken_up() == 1 ? "" : fmt::format(" ({} times in all)", attempt.taken_up());
  return fmt::format("{} at {}, taken up again at {}{}{}{}", attempt.earlier_outcome(),
                     time_text(attempt.earlier_ended_at_ms()), time_text(attempt.taken_up_at_ms()),
                     times, last.empty() ? "" : "; ", last);
}

void list(const LogsOptions& options) {
  Client client(options.coordinator);
  const v1::ListAttemptsResponse response = client.call(
      client.jobs(), &v1::JobService::Stub::ListAttempts,
      request_of<v1::ListAttemptsRequest>(options), "list the attempts of " + options.job);
  if (options.wants_json) {
    print_json(to_json_array(response.attempts()));
    return;
  }
  Table table({"ATTEMPT", "STAGE", "SHARDS", "WORKER", "PURPOSE", "OUTCOME", "BEGAN", "REMARK"});
  for (const v1::AttemptInfo& attempt : response.attempts()) {
    table.add({std::to_string(attempt.name().attempt()), attempt.stage(), shards_text(attempt),
               attempt.worker(), attempt.purpose(), attempt.outcome(),
               time_text(attempt.began_at_ms()), remark(attempt)});
  }
  fmt::print("{}", table.text());
}

// Prints the text without what a terminal would take for an order.
void print_text(const std::string& text) {
  std::string clean;
  for (const char c : text) {
    const bool is_printed = c == '\n' || c == '\t' || static_cast<unsigned char>(c) >= 0x20;
    clean += is_printed && c != 0x7f ? c : '?';
  }
  std::fwrite(clean.data(), 1, clean.size(), stdout);
}

void print(const LogsOptions& options) {
  Client client(options.coordinator);
  auto request = request_of<v1::ReadLogsRequest>(options);
  request.set_attempt(options.attempt);
  request.set_follow(options.is_followed);
  grpc::ClientContext context;
  Client::set_deadline(context, options.is_followed ? kFollowDeadline : kReadDeadline);
  const auto reader = client.jobs().ReadLogs(&context, request);
  v1::ReadLogsResponse response;
  while (reader->Read(&response)) {
    if (response.has_attempt()) {
      const v1::AttemptInfo& attempt = response.attempt();
      fmt::print("== {} shards {} on {}, attempt {}, {}\n", attempt.stage(), shards_text(attempt),
                 attempt.worker(), attempt.name().attempt(), attempt.outcome());
    }
    print_text(response.text());
    std::fflush(stdout);
  }
  client.check(reader->Finish(), "read the logs of " + options.job);
}

}  // namespace

void add_logs(CLI::App& app) {
  auto options = std::make_shared<LogsOptions>();
  CLI::App* command = add_command(app, "logs", kHelp);
  command->add_option("job", options->job, "Id of the job, or an unambiguous beginning of it")
      ->required();
  command->add_option("--task", options->task, "Only attempts at STAGE, or at STAGE/SHARD");
  CLI::Option* attempt =
      command->add_option("--attempt", options->attempt, "Only this attempt ('--list' names them)");
  CLI::Option* follow =
      command->add_flag("-f,--follow", options->is_followed, "Go on until the job has ended");
  CLI::Option* wants_list =
      command->add_flag("--list", options->is_list, "List the attempts, not their logs")
          ->excludes(attempt)
          ->excludes(follow);
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "With --list: print one JSON array on stdout")
      ->needs(wants_list);
  command->callback([options] { options->is_list ? list(*options) : print(*options); });
}

}  // namespace weft::cli
