#include <cstdio>
#include <memory>
#include <string>

#include <fmt/format.h>
#include <unistd.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/end_in_time.h"
#include "cli/fabric_reference.h"
#include "cli/import_database.h"
#include "cli/interruption.h"
#include "cli/output_file.h"
#include "cli/present.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "client/fabric_cache.h"
#include "client/fetch_version.h"
#include "core/error.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Bring a published version to a file.\n"
    "Only what is not here already comes over the wire: an older version at OUTPUT and the "
    "versions\n"
    "that were fetched for rendering are looked through for equal pieces. A fetch that was broken\n"
    "off, with Ctrl-C too, goes on where it was (OUTPUT.DIGEST.part); the file is checked against "
    "its digest before\n"
    "it gets its name.\n"
    "With --import, a file from elsewhere takes the same way: it is copied, read whole by a\n"
    "program that can do nothing else, and gets its name when everything in it is right.\n"
    "Examples: weft fetch silk@latest -o silk.h5\n"
    "          weft fetch --import from_a_friend.h5 -o linen.h5";

// What Ctrl-C gets from a coordinator that answers no more.
constexpr double kGraceSeconds = 2;

struct FetchOptions {
  security::Endpoint coordinator;
  std::string reference;
  std::string import;
  std::string output;
  bool wants_json = false;
};

// Bytes so far, on a terminal only: a fetch takes seconds. Ctrl-C ends the fetch.
client::FetchReport report_on(const Interruption& interruption) {
  return [&interruption, is_terminal = isatty(fileno(stderr)) == 1](std::uint64_t here,
                                                                    std::uint64_t total) {
    if (interruption.requested() && here < total) {
      throw core::Error(
          core::Code::kCancelled,
          fmt::format("{}stopped; {} of {} are kept: run the same command again to "
                      "go on",
                      is_terminal ? "\n" : "", format_bytes(here), format_bytes(total)));
    }
    if (is_terminal) {
      fmt::print(stderr, "\r\x1b[K{} of {}{}", format_bytes(here), format_bytes(total),
                 here == total ? "\n" : "");
    }
  };
}

void run_import(const FetchOptions& options) {
  if (!options.output.empty()) {
    check_output_file(options.output);
  }
  const ImportedDatabase imported = import_database(options.import, options.output);
  if (options.wants_json) {
    print_json({{"output", imported.path.string()},
                {"imported", options.import},
                {"size_bytes", imported.size_bytes},
                {"content_digest", imported.digest.hex()}});
    return;
  }
  fmt::print("{}: {} is whole, {}, content {}\n", imported.path.string(), options.import,
             format_bytes(imported.size_bytes), imported.digest.hex());
}

// Pieces of versions that were fetched for rendering, where there is a folder for them.
client::PieceIndex pieces_here() {
  try {
    return client::FabricCache(fabric_cache_folder(), 0).pieces();
  } catch (const core::Error&) {
    return {};
  }
}

std::string words_of(const client::FetchOutcome& outcome, const v1::Version& version) {
  if (outcome.was_there) {
    return "it was there already";
  }
  if (outcome.bytes_fetched == version.size_bytes()) {
    return fmt::format("fetched {}", format_bytes(version.size_bytes()));
  }
  return fmt::format("fetched {} of {}; the rest was here", format_bytes(outcome.bytes_fetched),
                     format_bytes(version.size_bytes()));
}

void run(const FetchOptions& options) {
  if (!options.import.empty()) {
    run_import(options);
    return;
  }
  const Interruption interruption(1);
  const EndInTime end(interruption, kGraceSeconds,
                      "stopped; what came is kept: run the same command again to go on");
  Client connection(options.coordinator);
  const v1::Version version = client::find_version(connection, options.reference);
  const std::string output =
      options.output.empty() ? reference_text(version) + ".h5" : options.output;
  check_output_file(output);
  const client::FetchOutcome outcome =
      client::fetch_version(connection, version, output, report_on(interruption), pieces_here());
  if (options.wants_json) {
    print_json({{"output", output},
                {"was_there", outcome.was_there},
                {"bytes_fetched", outcome.bytes_fetched},
                {"bytes_reused", outcome.bytes_reused},
                {"bytes_kept", outcome.bytes_kept},
                {"version", to_json(version)}});
    return;
  }
  fmt::print("{}: {}, content {}, {}\n", output, reference_text(version),
             short_digest(version.content_digest()), words_of(outcome, version));
}

}  // namespace

void add_fetch(CLI::App& app) {
  auto options = std::make_shared<FetchOptions>();
  CLI::App* command = add_command(app, "fetch", kHelp);
  CLI::Option* const reference = command->add_option("reference", options->reference,
                                                     "silk, silk@3, silk@latest or silk:approved");
  CLI::Option* const import =
      command->add_option("--import", options->import,
                          "Database file to take in, in place of a published version; without -o "
                          "it is kept among fetched fabrics");
  import->excludes(reference);
  reference->check(mistake_in_reference);
  command->add_option("-o,--output", options->output,
                      "Database to write; default: NAME@NUMBER.h5 in this folder");
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] {
    if (options->reference.empty() && options->import.empty()) {
      throw CLI::RequiredError("a version (NAME, NAME@NUMBER) or --import FILE");
    }
    run(*options);
  });
}

}  // namespace weft::cli
