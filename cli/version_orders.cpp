#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/fabric_reference.h"
#include "cli/present.h"
#include "cli/print_json.h"
#include "proto/limits.h"
#include "proto/names.h"

// What people order of published versions: names for them, and a step back.

namespace weft::cli {

namespace {

constexpr const char* kTagHelp =
    "Give a published version a further name.\n"
    "silk:approved then means that version, wherever a version is named, until the tag is moved "
    "or\n"
    "taken away. A tag is of a-z, 0-9, _, . and -, and not a number.\n"
    "Example: weft tag silk@3 approved";

constexpr const char* kUntagHelp =
    "Take a tag away from a published version.\n"
    "The version stays.\n"
    "Example: weft untag silk:approved";

constexpr const char* kRollbackHelp =
    "Make an older version of a fabric the latest again.\n"
    "Nothing is copied or removed: silk and silk@latest mean the older version until the next one\n"
    "is published, which gets the next number. 'weft log' keeps the step.\n"
    "Example: weft rollback silk@2 --comment \"the new white is too blue\"";

struct VersionOptions {
  security::Endpoint coordinator;
  std::string reference;
  std::string tag;
  std::string comment;
  bool wants_json = false;
};

std::string mistake_in_tag(const std::string& text) {
  return v1::is_tag(text) ? std::string()
                          : "'" + text +
                                "' is no tag; a tag is 1 to 64 characters of a-z, 0-9, _, . and -, "
                                "begins with a "
                                "letter or digit, and is neither a number nor 'latest'";
}

std::string mistake_in_tagged(const std::string& text) {
  const std::optional<FabricReference> reference = parse_reference(text);
  return reference && !reference->tag.empty() ? std::string()
                                              : "'" + text + "' names no tag; write NAME:TAG";
}

std::string mistake_in_older(const std::string& text) {
  const std::optional<FabricReference> reference = parse_reference(text);
  if (reference && !reference->version && reference->tag.empty()) {
    return "'" + text + "' is the latest already; name an older version, NAME@NUMBER or NAME:TAG";
  }
  return mistake_in_reference(text);
}

CLI::App* add_order(CLI::App& app, const std::string& name, const char* help,
                    const std::shared_ptr<VersionOptions>& options, const std::string& what,
                    std::string (*mistake)(const std::string&)) {
  CLI::App* command = add_command(app, name, help);
  command->add_option("version", options->reference, what)->required()->check(mistake);
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print the version as one JSON value on stdout");
  return command;
}

void print(const v1::Version& version, const VersionOptions& options, const std::string& words) {
  if (options.wants_json) {
    print_json(to_json(version));
  } else {
    fmt::print("{}\n", words);
  }
}

v1::Version order_tag(const VersionOptions& options, const v1::TagVersionRequest& request,
                      const std::string& doing) {
  Client client(options.coordinator);
  return client
      .call_repeatedly(client.catalogue(), &v1::CatalogueService::Stub::TagVersion, request, doing)
      .version();
}

void run_tag(const VersionOptions& options) {
  v1::TagVersionRequest request;
  request.set_request_id(new_request_id());
  request.set_reference(options.reference);
  request.set_tag(options.tag);
  const v1::Version version = order_tag(options, request, "tag " + options.reference);
  print(version, options,
        fmt::format("{}:{} is {}", version.fabric(), options.tag, reference_text(version)));
}

void run_untag(const VersionOptions& options) {
  const FabricReference reference = *parse_reference(options.reference);
  v1::TagVersionRequest request;
  request.set_request_id(new_request_id());
  request.set_fabric(reference.name);
  request.set_tag(reference.tag);
  const v1::Version version = order_tag(options, request, "untag " + options.reference);
  print(version, options,
        fmt::format("{} is no longer called {}", reference_text(version), options.reference));
}

void run_rollback(const VersionOptions& options) {
  Client client(options.coordinator);
  v1::RollBackRequest request;
  request.set_request_id(new_request_id());
  request.set_reference(options.reference);
  request.set_comment(options.comment);
  const v1::Version version =
      client
          .call_repeatedly(client.catalogue(), &v1::CatalogueService::Stub::RollBack, request,
                           "roll back to " + options.reference)
          .version();
  print(version, options,
        fmt::format("{}@latest is {}", version.fabric(), reference_text(version)));
}

}  // namespace

void add_tag(CLI::App& app) {
  auto options = std::make_shared<VersionOptions>();
  CLI::App* command =
      add_order(app, "tag", kTagHelp, options, "Which version, like silk@3", mistake_in_reference);
  command->add_option("tag", options->tag, "Its further name, like approved")
      ->required()
      ->check(mistake_in_tag);
  command->callback([options] { run_tag(*options); });
}

void add_untag(CLI::App& app) {
  auto options = std::make_shared<VersionOptions>();
  CLI::App* command = add_order(app, "untag", kUntagHelp, options, "The tag, like silk:approved",
                                mistake_in_tagged);
  command->callback([options] { run_untag(*options); });
}

void add_rollback(CLI::App& app) {
  auto options = std::make_shared<VersionOptions>();
  CLI::App* command = add_order(app, "rollback", kRollbackHelp, options,
                                "Which version, like silk@2", mistake_in_older);
  command->add_option("--comment", options->comment, "A line kept in the history (1024 bytes)")
      ->check([](const std::string& text) {
        return text.size() <= v1::kCommentLimitBytes ? std::string()
                                                     : "the comment is longer than 1024 bytes";
      });
  command->callback([options] { run_rollback(*options); });
}

}  // namespace weft::cli
