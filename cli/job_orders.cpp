#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/present.h"
#include "cli/print_json.h"

// What people order of a job: each order is one call, answered with the job.

namespace weft::cli {

namespace {

constexpr const char* kCancelHelp =
    "End a job.\n"
    "What it has computed stays with the coordinator and serves later jobs.\n"
    "A job that has ended already is left as it is.\n"
    "Example: weft cancel j4f1c02a9d3be";

constexpr const char* kPauseHelp =
    "Stop the work of a job until it is resumed.\n"
    "What workers compute of it is stopped within seconds; what they had finished stays.\n"
    "Example: weft pause j4f1c02a9d3be";

constexpr const char* kResumeHelp =
    "Go on with a job that was paused.\n"
    "Example: weft resume j4f1c02a9d3be";

constexpr const char* kRetryHelp =
    "Put a job that failed or was cancelled back into the queue.\n"
    "Its failures are forgotten, its results are kept: only what is missing is computed.\n"
    "Example: weft retry j4f1c02a9d3be";

constexpr const char* kPriorityHelp =
    "Change how early a job is served.\n"
    "From -100 to 100, the higher the earlier; waiting raises it by one step in five minutes.\n"
    "Example: weft priority j4f1c02a9d3be 10";

struct OrderOptions {
  security::Endpoint coordinator;
  std::string job;
  std::int32_t priority = 0;
  bool wants_json = false;
};

template <class Request, class Response>
using Method = grpc::Status (v1::JobService::Stub::*)(grpc::ClientContext*, const Request&,
                                                      Response*);

template <class Request, class Response>
void run(const OrderOptions& options, Method<Request, Response> method, Request request,
         const std::string& verb) {
  Client client(options.coordinator);
  request.set_request_id(new_request_id());
  request.set_job_id(options.job);
  const v1::Job job =
      client.call_repeatedly(client.jobs(), method, request, verb + " " + options.job).job();
  if (options.wants_json) {
    print_json(to_json(job));
    return;
  }
  fmt::print("{} ({}) is {}{}, priority {}\n", job.id(), job.fabric(), state_text(job.state()),
             job.paused() ? ", paused" : "", job.priority());
}

CLI::App* add_order(CLI::App& app, const std::string& name, const char* help,
                    const std::shared_ptr<OrderOptions>& options) {
  CLI::App* command = add_command(app, name, help);
  command->add_option("job", options->job, "Id of the job, or an unambiguous beginning of it")
      ->required();
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print the job as one JSON value on stdout");
  return command;
}

template <class Request, class Response>
void add_simple_order(CLI::App& app, const std::string& name, const char* help,
                      Method<Request, Response> method) {
  auto options = std::make_shared<OrderOptions>();
  add_order(app, name, help, options)->callback([options, method, name] {
    run(*options, method, Request(), name);
  });
}

}  // namespace

void add_cancel(CLI::App& app) {
  add_simple_order(app, "cancel", kCancelHelp, &v1::JobService::Stub::CancelJob);
}

void add_pause(CLI::App& app) {
  add_simple_order(app, "pause", kPauseHelp, &v1::JobService::Stub::PauseJob);
}

void add_resume(CLI::App& app) {
  add_simple_order(app, "resume", kResumeHelp, &v1::JobService::Stub::ResumeJob);
}

void add_retry(CLI::App& app) {
  add_simple_order(app, "retry", kRetryHelp, &v1::JobService::Stub::RetryJob);
}

void add_priority(CLI::App& app) {
  auto options = std::make_shared<OrderOptions>();
  CLI::App* command = add_order(app, "priority", kPriorityHelp, options);
  command->add_option("priority", options->priority, "-100 to 100")
      ->required()
      ->check(CLI::Range(-100, 100));
  command->callback([options] {
    v1::SetPriorityRequest request;
    request.set_priority(options->priority);
    run(*options, &v1::JobService::Stub::SetPriority, request, "change the priority of");
  });
}

}  // namespace weft::cli
