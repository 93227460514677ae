#include "cli/recolor.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/colourway_source.h"
#include "cli/make_colourway.h"
#include "cli/output_file.h"
#include "cli/print_json.h"
#include "cli/recolor_report.h"
#include "cli/split_materials.h"
#include "cli/trace_colourway.h"
#include "client/fetch_version.h"
#include "client/publish_colourway.h"
#include "core/clock.h"
#include "core/error.h"
#include "proto/limits.h"
#include "proto/names.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "The same cloth in other colours.\n"
    "FABRIC is a database (.h5) or a published version (silk, silk@3). Geometry and visibility "
    "are\n"
    "reused, and light is carried over from the paths that were traced, in seconds: into the file\n"
    "-o, or, of a published version without -o, into a new version with the coordinator, which\n"
    "says so. With --exact light is traced anew: of a published version into a new one, of a file\n"
    "into -o.\n"
    "A YARN is the name of one, 'warp', 'weft' or 'all'. A COLOUR is #7a1f2b (sRGB),\n"
    "linear:0.195,0.014,0.024 or lab:27.2,38.1,17.5 (D65): what the yarn shows on average, where "
    "a\n"
    "flat swatch lit at 45 degrees is seen from above; Delta E 2000 is below 1 "
    "(docs/colourways.md).\n"
    "Examples:\n"
    "  weft recolor silk.h5 --yarn all=#7a1f2b -o claret.h5\n"
    "  weft recolor shot@2 --yarn warp=#7a1f2b --yarn weft=lab:50,-15,-8 -o shot.h5\n"
    "  weft recolor shot@2 --yarn warp=#7a1f2b";

struct RecolorOptions {
  security::Endpoint coordinator;
  std::string fabric;
  std::vector<std::string> yarns;
  std::string output;
  std::string name;
  std::string cache;
  double exposure = 0;  // 0: the cloth's own
  unsigned threads = 0;
  bool is_exact = false;
  bool takes_nearest = false;
  bool is_dry_run = false;
  bool wants_json = false;
};

// What is kept with a version for people.
std::string comment_of(const RecolorOptions& options, const ColourwayRequest& request) {
  std::string comment = "colourway of " + request.source->reference + ":";
  for (const std::string& yarn : options.yarns) {
    comment += " " + yarn;
  }
  return comment.substr(0, v1::kCommentLimitBytes);
}

// A file of this process' own, gone when this is.
class PassingFile {
 public:
  PassingFile() {
    std::string folder = (std::filesystem::temp_directory_path() / "weft-recolor-XXXXXX").string();
    if (::mkdtemp(folder.data()) == nullptr) {
      throw core::Error(core::Code::kUnavailable,
                        "cannot make a folder in " +
                            std::filesystem::temp_directory_path().string() +
                            "; name one that can be written in TMPDIR");
    }
    folder_ = folder;
  }
  ~PassingFile() {
    std::error_code ignored;  // a file left over does no harm
    std::filesystem::remove_all(folder_, ignored);
  }
  PassingFile(const PassingFile&) = delete;
  PassingFile& operator=(const PassingFile&) = delete;
  PassingFile(PassingFile&&) = delete;
  PassingFile& operator=(PassingFile&&) = delete;

  [[nodiscard]] std::filesystem::path path() const { return folder_ / "colourway.h5"; }

 private:
  std::filesystem::path folder_;
};

// Into a file, or else into a version of the coordinator that has the base.
Recolored make_carried(const RecolorOptions& options, const ColourwayModel& model,
                       const ColourwayRequest& request) {
  CarriedColourway carried = carry_colourway(model, request);
  Recolored made;
  made.fit = std::move(carried.fit);
  made.error = carried.error;
  if (options.is_dry_run) {
    return made;
  }
  const auto write = [&carried](const std::filesystem::path& path) {
    return storage::write_database(carried.contents.database, carried.contents.recolouring, path);
  };
  if (!options.output.empty()) {
    made.output = options.output;
    made.digest = write(options.output).hex();
    return made;
  }
  const PassingFile file;
  const core::Digest digest = write(file.path());
  Client connection(options.coordinator);
  const v1::Version version = client::publish_colourway(
      connection,
      {file.path(), digest, request.name, model.base.reference, comment_of(options, request)});
  made.version = client::reference_text(version);
  made.digest = client::version_digest(version).hex();
  return made;
}

void run(const RecolorOptions& options) {
  if (!options.name.empty() && !v1::is_fabric_name(options.name)) {
    throw core::Error(
        core::Code::kInvalidArgument,
        "--name " + options.name + " is no name; use small letters, digits, _ and -, at most 64");
  }
  if (!options.output.empty()) {
    check_output_file(options.output);
  }
  const core::Stopwatch since_start;
  ColourwaySource source = open_colourway_source(options.fabric, options.coordinator);
  if (options.output.empty() && !options.is_dry_run && !source.is_published) {
    throw CLI::RequiredError("--output");
  }
  const unsigned threads =
      options.threads > 0 ? options.threads : std::max(1U, std::thread::hardware_concurrency());
  std::optional<ColourwaySource> base = base_of(source, options.coordinator);
  const std::vector<MaterialSplit> splits =
      material_splits(options.yarns, source.contents.database);
  if (base) {
    std::vector<MaterialSplit> all =
        splits_between(base->contents.database, source.contents.database);
    all.insert(all.end(), splits.begin(), splits.end());
    split_materials(all, *base, threads);
  }
  split_materials(splits, source, threads);
  ColourwayRequest request;
  request.source = &source;
  request.targets = colour_targets(options.yarns, source.contents.database);
  request.name = options.name.empty() ? source.description.name() : options.name;
  request.takes_nearest = options.takes_nearest;
  const ColourwayModel model(base ? *base : source, threads);
  request.exposure = options.exposure > 0 ? options.exposure : own_exposure(model);
  const TraceOptions tracing{options.coordinator,   options.output,
                             options.cache,         comment_of(options, request),
                             options.takes_nearest, options.is_dry_run};
  const Recolored made = options.is_exact ? trace_colourway(tracing, model, request)
                                          : make_carried(options, model, request);
  const double seconds = since_start.seconds();
  if (options.wants_json) {
    print_json(to_json(made, request, model.base.reference, seconds));
  } else {
    print_text(made, request, model.base.reference, seconds);
  }
}

}  // namespace

void add_recolor(CLI::App& app) {
  auto options = std::make_shared<RecolorOptions>();  // shared: the callback outlives this function
  CLI::App* command = add_command(app, "recolor", kHelp);
  command->add_option("fabric", options->fabric, "Database (.h5) or published version")->required();
  command
      ->add_option("--yarn", options->yarns,
                   "YARN=COLOUR, what a yarn shall show (as often as needed)")
      ->allow_extra_args(false)
      ->required();
  command->add_option("-o,--output", options->output, "Database to write (.h5)");
  command->add_option("--name", options->name, "Name of the new fabric (default: the old one's)");
  command->add_flag("--exact", options->is_exact,
                    "Trace the light in the new colours, as 'weft run' and 'weft submit' do");
  command->add_flag("--nearest", options->takes_nearest,
                    "Take the nearest colour where one cannot be reached");
  command->add_flag("--dry-run", options->is_dry_run,
                    "Only say what the fibres would be and what they would show");
  command
      ->add_option("--exposure", options->exposure,
                   "What a perfect white diffuser shows where colours are measured (default: so "
                   "much that the cloth shows 1 with the brightest dyes)")
      ->check(CLI::Range(1e-3, 1e4));
  command->add_option("--cache", options->cache,
                      "With --exact: folder of finished work, such as that of 'weft run --cache'");
  command->add_option("--threads", options->threads, "Threads to compute on; default: all cores")
      ->check(CLI::Range(1U, 1024U));
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
