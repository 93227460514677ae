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
    "List the published fabrics, with the latest version of each.\n"
    "PUBLISHED is UTC.\n"
    "Example: weft fabrics";

struct FabricsOptions {
  security::Endpoint coordinator;
  bool wants_json = false;
};

void run(const FabricsOptions& options) {
  Client client(options.coordinator);
  const v1::ListFabricsResponse response =
      client.call(client.catalogue(), &v1::CatalogueService::Stub::ListFabrics,
                  v1::ListFabricsRequest(), "list the fabrics");
  if (options.wants_json) {
    print_json(to_json_array(response.fabrics()));
    return;
  }
  Table table({"FABRIC", "VERSIONS", "LATEST", "CONTENT", "SIZE", "PUBLISHED"});
  for (const v1::Fabric& fabric : response.fabrics()) {
    const v1::Version& latest = fabric.latest();
    table.add({fabric.name(), std::to_string(fabric.versions()), reference_text(latest),
               short_digest(latest.content_digest()), format_bytes(latest.size_bytes()),
               time_text(latest.published_at_ms())});
  }
  fmt::print("{}", table.text());
}

}  // namespace

void add_fabrics(CLI::App& app) {
  auto options = std::make_shared<FabricsOptions>();
  CLI::App* command = add_command(app, "fabrics", kHelp);
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON array on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
