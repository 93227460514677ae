#include <chrono>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/fabric_reference.h"
#include "cli/present.h"
#include "cli/print_json.h"
#include "cli/table.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Show what changed from one published version to another.\n"
    "First the fields of the description, then the datasets that differ: LARGEST and RMS are of\n"
    "the differences, and the last column is RMS over that of the first version's values. The\n"
    "versions may be of two fabrics.\n"
    "Example: weft diff silk@2 silk@3";

struct DiffOptions {
  security::Endpoint coordinator;
  std::string from;
  std::string to;
  bool wants_json = false;
};

// The coordinator puts both files together and reads them.
constexpr std::chrono::seconds kDiffDeadline{600};

v1::DiffVersionsResponse ask(const DiffOptions& options) {
  Client client(options.coordinator);
  v1::DiffVersionsRequest request;
  request.set_from(options.from);
  request.set_to(options.to);
  grpc::ClientContext context;
  Client::set_deadline(context, kDiffDeadline);
  v1::DiffVersionsResponse response;
  client.check(client.catalogue().DiffVersions(&context, request, &response),
               "compare " + options.from + " and " + options.to);
  return response;
}

std::string share_text(double part, double whole) {
  return whole > 0 ? fmt::format("{:.2g} %", 100 * part / whole) : "-";
}

void print_datasets(const v1::DiffVersionsResponse& response) {
  Table table({"DATASET", "LARGEST", "RMS", "OF FIRST"});
  int equal = 0;
  for (const v1::DatasetChange& dataset : response.datasets()) {
    if (dataset.equal()) {
      ++equal;
    } else if (dataset.shape_from() != dataset.shape_to()) {
      const auto shape = [](const std::string& text) { return text.empty() ? "nothing" : text; };
      table.add({dataset.path(),
                 fmt::format("{} -> {}", shape(dataset.shape_from()), shape(dataset.shape_to())),
                 "", ""});
    } else if (dataset.rms_from() == 0 && dataset.largest_difference() == 0) {
      table.add({dataset.path(), "other text", "", ""});
    } else {
      table.add({dataset.path(), fmt::format("{:.3g}", dataset.largest_difference()),
                 fmt::format("{:.3g}", dataset.rms_difference()),
                 share_text(dataset.rms_difference(), dataset.rms_from())});
    }
  }
  if (equal < response.datasets_size()) {
    fmt::print("{}", table.text());
  }
  fmt::print("{} of {} datasets are equal; {} of {}'s {} are pieces that {} has too\n", equal,
             response.datasets_size(), format_bytes(response.shared_bytes()),
             reference_text(response.to()), format_bytes(response.to().size_bytes()),
             reference_text(response.from()));
}

void run(const DiffOptions& options) {
  const v1::DiffVersionsResponse response = ask(options);
  if (options.wants_json) {
    print_json(to_json(response));
    return;
  }
  for (const v1::FieldChange& field : response.fields()) {
    fmt::print("{}: {} -> {}\n", field.path(), field.from().empty() ? "nothing" : field.from(),
               field.to().empty() ? "nothing" : field.to());
  }
  print_datasets(response);
}

}  // namespace

void add_diff(CLI::App& app) {
  auto options = std::make_shared<DiffOptions>();
  CLI::App* command = add_command(app, "diff", kHelp);
  command->add_option("from", options->from, "A version, like silk@2")
      ->required()
      ->check(mistake_in_reference);
  command->add_option("to", options->to, "Another, like silk@3")
      ->required()
      ->check(mistake_in_reference);
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
