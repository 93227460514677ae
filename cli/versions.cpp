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
    "List the published versions of a fabric, newest first.\n"
    "Equal CONTENT means equal files.\n"
    "Example: weft versions silk";

struct VersionsOptions {
  security::Endpoint coordinator;
  std::string fabric;
  bool wants_json = false;
};

void run(const VersionsOptions& options) {
  Client client(options.coordinator);
  v1::ListVersionsRequest request;
  request.set_fabric(options.fabric);
  const v1::ListVersionsResponse response =
      client.call(client.catalogue(), &v1::CatalogueService::Stub::ListVersions, request,
                  "list the versions of " + options.fabric);
  if (options.wants_json) {
    print_json(to_json_array(response.versions()));
    return;
  }
  Table table({"VERSION", "CONTENT", "SIZE", "PUBLISHED", "JOB", "COMMENT"});
  for (const v1::Version& version : response.versions()) {
    table.add({reference_text(version), short_digest(version.content_digest()),
               format_bytes(version.size_bytes()), time_text(version.published_at_ms()),
               version.job_id(), version.comment()});
  }
  fmt::print("{}", table.text());
}

}  // namespace

void add_versions(CLI::App& app) {
  auto options = std::make_shared<VersionsOptions>();
  CLI::App* command = add_command(app, "versions", kHelp);
  command->add_option("fabric", options->fabric, "Name of a published fabric, like silk")
      ->required();
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON array on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
