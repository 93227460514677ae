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
    "Equal CONTENT means equal files. SHARED is how much of the file was on the disk before, and\n"
    "REUSED how many of the results it was made from had been computed before, or the version "
    "from\n"
    "which 'weft recolor' carried its light over.\n"
    "Example: weft versions silk";

struct VersionsOptions {
  security::Endpoint coordinator;
  std::string fabric;
  bool wants_json = false;
};

std::string tags_text(const v1::Version& version, bool is_latest) {
  std::string text = is_latest ? "latest" : "";
  for (const std::string& tag : version.tags()) {
    text += (text.empty() ? "" : ",") + tag;
  }
  return text;
}

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
  const std::uint64_t latest = client::find_version(client, options.fabric).number();
  Table table({"VERSION", "TAGS", "CONTENT", "SIZE", "SHARED", "REUSED", "PUBLISHED", "USER", "JOB",
               "COMMENT"});
  for (const v1::Version& version : response.versions()) {
    table.add({reference_text(version), tags_text(version, version.number() == latest),
               short_digest(version.content_digest()), format_bytes(version.size_bytes()),
               format_bytes(version.shared_bytes()), reused_text(version),
               time_text(version.published_at_ms()), version.user(), version.job_id(),
               version.comment()});
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
