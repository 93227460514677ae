#include <map>
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
    "Show what a fabric's versions went through, newest first.\n"
    "Publications, with what was saved by earlier work (SHARED bytes of the file, REUSED "
    "results),\n"
    "tags and rollbacks, and who did it.\n"
    "Example: weft log silk";

struct LogOptions {
  security::Endpoint coordinator;
  std::string fabric;
  std::uint32_t limit = 0;
  bool wants_json = false;
};

std::string words_of(const v1::HistoryEntry& entry) {
  if (entry.action() == "rolled_back") {
    return "rolled back to";
  }
  return entry.tag().empty() ? entry.action() : entry.action() + " " + entry.tag();
}

void run(const LogOptions& options) {
  Client client(options.coordinator);
  v1::ListHistoryRequest request;
  request.set_fabric(options.fabric);
  request.set_limit(options.limit);
  const v1::ListHistoryResponse response =
      client.call(client.catalogue(), &v1::CatalogueService::Stub::ListHistory, request,
                  "show the history of " + options.fabric);
  if (options.wants_json) {
    print_json(to_json_array(response.entries()));
    return;
  }
  v1::ListVersionsRequest about;
  about.set_fabric(options.fabric);
  const v1::ListVersionsResponse listed =
      client.call(client.catalogue(), &v1::CatalogueService::Stub::ListVersions, about,
                  "list the versions of " + options.fabric);
  std::map<std::uint64_t, v1::Version> versions;
  for (const v1::Version& version : listed.versions()) {
    versions[version.number()] = version;
  }
  Table table({"WHEN", "WHAT", "VERSION", "SIZE", "SHARED", "REUSED", "USER", "COMMENT"});
  for (const v1::HistoryEntry& entry : response.entries()) {
    const v1::Version& version = versions[entry.number()];
    const bool is_publication = entry.action() == "published";
    table.add({time_text(entry.at_ms()), words_of(entry),
               fmt::format("{}@{}", options.fabric, entry.number()),
               is_publication ? format_bytes(version.size_bytes()) : "",
               is_publication ? format_bytes(version.shared_bytes()) : "",
               is_publication ? reused_text(version) : "", entry.user(), entry.comment()});
  }
  fmt::print("{}", table.text());
}

}  // namespace

void add_log(CLI::App& app) {
  auto options = std::make_shared<LogOptions>();
  CLI::App* command = add_command(app, "log", kHelp);
  command->add_option("fabric", options->fabric, "Name of a published fabric, like silk")
      ->required();
  command->add_option("--limit", options->limit, "At most so many steps; default: 1000")
      ->check(CLI::Range(1U, v1::kListLimit));
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON array on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
