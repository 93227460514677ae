#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/present.h"
#include "cli/print_json.h"

// What operators order of a worker: each order is one call, answered with the workers of that name.

namespace weft::cli {

namespace {

constexpr const char* kDrainHelp =
    "Give a worker nothing more.\n"
    "It finishes what it computes. The order holds for its name, also when it is started again,\n"
    "until 'weft drain --undo'.\n"
    "Example: weft drain render-07";

constexpr const char* kUnblockHelp =
    "Give a blocked worker another chance.\n"
    "A worker is blocked for a kind of task when tasks that failed on it passed elsewhere. Mend "
    "it\n"
    "first: 'weft explain worker NAME' says what failed.\n"
    "Example: weft unblock render-07 --stage transfer";

struct OrderOptions {
  security::Endpoint coordinator;
  std::string worker;
  std::string stage;
  bool is_undone = false;
  bool wants_json = false;
};

CLI::App* add_order(CLI::App& app, const std::string& name, const char* help,
                    const std::shared_ptr<OrderOptions>& options) {
  CLI::App* command = add_command(app, name, help);
  command
      ->add_option("worker", options->worker,
                   "Name of the worker, its id or an unambiguous beginning of that")
      ->required();
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print the workers as one JSON array on stdout");
  return command;
}

template <class Response>
void print(const Response& response, const OrderOptions& options) {
  if (options.wants_json) {
    print_json(to_json_array(response.workers()));
    return;
  }
  for (const v1::Worker& worker : response.workers()) {
    fmt::print("{} ({}) is {}\n", worker.name(), worker.id(), condition_text(worker));
  }
  if (response.workers().empty()) {
    fmt::print("{}: noted; no worker of that name is connected\n", options.worker);
  }
}

void run_drain(const OrderOptions& options) {
  Client client(options.coordinator);
  v1::DrainWorkerRequest request;
  request.set_request_id(new_request_id());
  request.set_worker(options.worker);
  request.set_undrain(options.is_undone);
  print(client.call_repeatedly(client.workers(), &v1::WorkersService::Stub::DrainWorker, request,
                               "drain " + options.worker),
        options);
}

void run_unblock(const OrderOptions& options) {
  Client client(options.coordinator);
  v1::UnblockWorkerRequest request;
  request.set_request_id(new_request_id());
  request.set_worker(options.worker);
  request.set_stage(options.stage);
  print(client.call_repeatedly(client.workers(), &v1::WorkersService::Stub::UnblockWorker, request,
                               "unblock " + options.worker),
        options);
}

}  // namespace

void add_drain(CLI::App& app) {
  auto options = std::make_shared<OrderOptions>();
  CLI::App* command = add_order(app, "drain", kDrainHelp, options);
  command->add_flag("--undo", options->is_undone, "Give it work again");
  command->callback([options] { run_drain(*options); });
}

void add_unblock(CLI::App& app) {
  auto options = std::make_shared<OrderOptions>();
  CLI::App* command = add_order(app, "unblock", kUnblockHelp, options);
  command->add_option("--stage", options->stage, "Only for this kind of task, like transfer");
  command->callback([options] { run_unblock(*options); });
}

}  // namespace weft::cli
