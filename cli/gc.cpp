#include <chrono>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/present.h"
#include "cli/print_json.h"
#include "proto/limits.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Remove what the coordinator keeps and nothing refers to any more.\n"
    "That is: pieces of files that no version has, and results that no version was made from, no\n"
    "unfinished job has and nobody used for --keep. Published versions are never removed, nor "
    "what\n"
    "they were made from. What goes is moved to a trash, from which it comes back by itself when "
    "a\n"
    "job uses it; --empty-trash deletes what an earlier run put there. Jobs may run meanwhile.\n"
    "Example: weft gc --dry-run";

struct GcOptions {
  security::Endpoint coordinator;
  std::uint64_t grace_seconds = 24 * 3600;
  std::uint64_t keep_seconds = 30 * 24 * 3600;
  bool is_dry_run = false;
  bool empties_trash = false;
  bool wants_json = false;
};

constexpr std::chrono::seconds kGcDeadline{3600};

void run(const GcOptions& options) {
  Client client(options.coordinator);
  v1::CollectGarbageRequest request;
  request.set_request_id(new_request_id());
  request.set_dry_run(options.is_dry_run);
  request.set_grace_seconds(options.grace_seconds);
  request.set_keep_unpublished_seconds(options.keep_seconds);
  request.set_empty_trash(options.empties_trash);
  grpc::ClientContext context;
  Client::set_deadline(context, kGcDeadline);
  v1::CollectGarbageResponse response;
  client.check(client.catalogue().CollectGarbage(&context, request, &response), "collect garbage");
  if (options.wants_json) {
    print_json(to_json(response));
    return;
  }
  for (const std::string& example : response.examples()) {
    fmt::print("{}\n", example);
  }
  const char* const would = options.is_dry_run ? "would be " : "";
  fmt::print("{} blobs ({}) {}moved to the trash, {} ({}) kept\n", response.blobs_removed(),
             format_bytes(response.bytes_removed()), would, response.blobs_kept(),
             format_bytes(response.bytes_kept()));
  if (options.empties_trash) {
    fmt::print("{} blobs ({}) {}deleted from the trash\n", response.trash_blobs_removed(),
               format_bytes(response.trash_bytes_removed()), would);
  }
}

}  // namespace

void add_gc(CLI::App& app) {
  auto options = std::make_shared<GcOptions>();
  CLI::App* command = add_command(app, "gc", kHelp);
  command->add_flag("--dry-run", options->is_dry_run, "Only say what would go");
  const std::map<std::string, std::uint64_t> units{
      {"s", 1}, {"m", 60}, {"h", 3600}, {"d", 24 * 3600}};
  command
      ->add_option("--grace", options->grace_seconds,
                   "Leave alone what was used within this time, like 90m or 2d; default: 1d")
      ->transform(CLI::AsNumberWithUnit(units, CLI::AsNumberWithUnit::CASE_INSENSITIVE))
      ->check(CLI::Range(v1::kGraceLeastSeconds, v1::kGraceLimitSeconds));
  command
      ->add_option("--keep", options->keep_seconds,
                   "Keep results of no version for this time since their last use; default: 30d")
      ->transform(CLI::AsNumberWithUnit(units, CLI::AsNumberWithUnit::CASE_INSENSITIVE))
      ->check(CLI::Range(v1::kGraceLeastSeconds, v1::kGraceLimitSeconds));
  command->add_flag("--empty-trash", options->empties_trash,
                    "Delete what has lain in the trash for longer than --grace");
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
