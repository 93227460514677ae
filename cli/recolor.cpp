#include "cli/recolor.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/colour_text.h"
#include "cli/colourway_source.h"
#include "cli/fabric_reference.h"
#include "cli/follow_job.h"
#include "cli/local_run.h"
#include "cli/make_colourway.h"
#include "cli/output_file.h"
#include "cli/present.h"
#include "cli/print_json.h"
#include "cli/split_materials.h"
#include "client/fetch_version.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "proto/limits.h"
#include "proto/names.h"
#include "shading/colour_space.h"

namespace weft::cli {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kHelp =
    "The same cloth in other colours.\n"
    "FABRIC is a database (.h5) or a published version (silk, silk@3). Geometry and visibility "
    "are\n"
    "reused. With -o, light is carried over from the paths that were traced, in seconds, into "
    "that\n"
    "file. Of a published version without -o, or with --exact, it is traced anew: into a new\n"
    "version with the coordinator, or, of a file, into -o.\n"
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

// What was made, as far as it was.
struct Recolored {
  ColourFit fit;
  std::optional<CarryError> error;  // of light that was carried over
  std::string version;              // that was published
  std::string digest;               // of the contents; empty in a dry run
};

v1::Job publish(const v1::FabricDescription& description, const std::string& comment,
                Client& connection) {
  Interruption interruption(kFollowInterrupts);
  v1::SubmitRequest request;
  request.set_request_id(new_request_id());
  *request.mutable_description() = description;
  request.mutable_options()->set_comment(comment.substr(0, v1::kCommentLimitBytes));
  v1::Job job = connection
                    .call_repeatedly(connection.jobs(), &v1::JobService::Stub::Submit, request,
                                     "submit " + description.name())
                    .job();
  fmt::print(stderr, "submitted {} as {}; 'weft watch {}' shows how far it is\n", job.fabric(),
             job.id(), job.id());
  job = follow_job(connection, job.id(), interruption);
  throw_unless_succeeded(job);
  return job;
}

// Traces the description: by the coordinator where the source is published, else here, with every
// shard kept until the end. Leaves the database at options.output, if that names a file, and
// returns its name.
std::filesystem::path trace(const RecolorOptions& options, const ColourwayModel& model,
                            const ColourwayRequest& request,
                            const v1::FabricDescription& description, Recolored& made) {
  if (request.source->is_published) {
    Client connection(options.coordinator);
    std::string comment = "colourway of " + request.source->reference + ":";
    for (const std::string& yarn : options.yarns) {
      comment += " " + yarn;
    }
    const v1::Job job = publish(description, comment, connection);
    made.version = client::reference_text(job.version());
    made.digest = client::version_digest(job.version()).hex();
    if (!options.output.empty()) {
      client::fetch_version(connection, job.version(), options.output, nullptr);
      return options.output;
    }
    return {};
  }
  const bool is_own_cache = options.cache.empty();
  const std::filesystem::path folder = is_own_cache ? options.output + ".weft" : options.cache;
  core::Interrupt interrupt;
  std::optional<FolderLock> lock;
  if (is_own_cache) {
    lock.emplace(folder);
  }
  ResultCache cache(folder);
  ProgressPrinter printer(stderr);
  const LocalRunHooks hooks{
      [&](const std::vector<StageProgress>& stages) { printer.update(stages); },
      [&] { return interrupt.requested(); }};
  const LocalRunResult result =
      run_locally(description, model.threads, cache, options.output, hooks);
  printer.finish(result.stages);
  made.digest = result.content_digest.hex();
  return options.output;
}

// Traces the new colours, measures them, and mends the dyes as far as carried-over light was wrong.
Recolored make_exactly(const RecolorOptions& options, const ColourwayModel& model,
                       const ColourwayRequest& request) {
  constexpr int kMostRounds = 3;
  Recolored made;
  const coordinator::OrderLevels levels = levels_of_fit(model, request);
  std::vector<glm::dvec3> correction(request.targets.size(), glm::dvec3(1));
  for (int round = 0;; ++round) {
    made.fit = fit_colourway(model, request, levels, correction);
    check_reached(request, made.fit);
    if (options.is_dry_run) {
      return made;
    }
    const std::filesystem::path path =
        trace(options, model, request, recolored_description(request, made.fit), made);
    measure_fit(model, request,
                storage::read_database(
                    path.empty() ? resolve_fabric(made.version, options.coordinator) : path),
                made.fit, correction);
    const bool is_met = made.fit.worst_delta_e() < kPromisedDeltaE;
    if (is_met || options.takes_nearest || round + 1 == kMostRounds) {
      break;
    }
    fmt::print(stderr, "traced, the colours are Delta E 2000 {:.2f} off; again\n",
               made.fit.worst_delta_e());
  }
  if (options.cache.empty() && !request.source->is_published) {
    std::error_code ignored;  // the database is written; a folder left over does no harm
    std::filesystem::remove_all(options.output + ".weft", ignored);
  }
  check_reached(request, made.fit);
  return made;
}

Recolored make_carried(const RecolorOptions& options, const ColourwayModel& model,
                       const ColourwayRequest& request) {
  CarriedColourway carried = carry_colourway(model, request);
  Recolored made;
  made.fit = std::move(carried.fit);
  made.error = carried.error;
  if (!options.is_dry_run) {
    made.digest = storage::write_database(carried.contents.database, carried.contents.recolouring,
                                          options.output)
                      .hex();
  }
  return made;
}

Json colour_json(glm::dvec3 linear) {
  const glm::dvec3 lab = shading::lab_from_linear(linear);
  return {{"hex", hex_text(linear)},
          {"linear", {linear.x, linear.y, linear.z}},
          {"lab", {lab.x, lab.y, lab.z}}};
}

Json to_json(const Recolored& made, const ColourwayRequest& request, const std::string& base,
             const RecolorOptions& options, double seconds) {
  const std::vector<std::string>& names = request.source->contents.database.material_names;
  Json targets = Json::array();
  for (std::size_t t = 0; t < request.targets.size(); ++t) {
    const YarnTarget& target = request.targets[t];
    Json materials = Json::array();
    for (const std::size_t m : target.materials) {
      const shading::FibreMaterial& material = made.fit.materials[m];
      materials.push_back({{"name", names[m]},
                           {"c_r", {material.c_r.x, material.c_r.y, material.c_r.z}},
                           {"c_tt", {material.c_tt.x, material.c_tt.y, material.c_tt.z}}});
    }
    targets.push_back({{"yarns", target.label},
                       {"asked", colour_json(target.linear)},
                       {"shown", colour_json(made.fit.reached[t])},
                       {"delta_e_2000", made.fit.delta_e[t]},
                       {"materials", materials}});
  }
  Json json{{"fabric", request.name},
            {"of", request.source->reference},
            {"exact", options.is_exact},
            {"output", nullptr},
            {"version", nullptr},
            {"content_digest", nullptr},
            {"targets", targets},
            {"carried_over", nullptr},
            {"exposure", request.exposure},
            {"pictures", made.fit.pictures},
            {"seconds", seconds}};
  if (!options.output.empty() && !options.is_dry_run) {
    json["output"] = options.output;
  }
  if (!made.version.empty()) {
    json["version"] = made.version;
  }
  if (!made.digest.empty()) {
    json["content_digest"] = made.digest;
  }
  if (made.error) {
    json["carried_over"] = {{"from", base},
                            {"light_error", made.error->light},
                            {"light_error_noise", made.error->light_noise},
                            {"matrix_error", made.error->matrix},
                            {"cells_compared", made.error->cells}};
  }
  return json;
}

void print_text(const Recolored& made, const ColourwayRequest& request, const std::string& base,
                const RecolorOptions& options, double seconds) {
  fmt::print("measured where a white diffuser shows {:.3g}\n", request.exposure);
  for (std::size_t t = 0; t < request.targets.size(); ++t) {
    fmt::print("{}: asked {}, shows {}, Delta E 2000 {:.2f}\n", request.targets[t].label,
               hex_text(request.targets[t].linear), hex_text(made.fit.reached[t]),
               made.fit.delta_e[t]);
  }
  if (made.error) {
    fmt::print("light carried over from {}: off by {:.1f} % (+- {:.1f} %), matrices by {:.1f} %\n",
               base, 100 * made.error->light, 100 * made.error->light_noise,
               100 * made.error->matrix);
  }
  const std::string what = options.is_dry_run       ? "nothing was written"
                           : options.output.empty() ? made.version
                           : made.version.empty()
                               ? options.output
                               : fmt::format("{}, {}", made.version, options.output);
  const std::string content = made.digest.empty() ? "" : ", content " + made.digest.substr(0, 12);
  fmt::print("{}{}, in {}\n", what, content, format_duration(seconds));
}

void run(RecolorOptions options) {
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
  if (options.output.empty() && !options.is_dry_run) {
    if (!source.is_published) {
      throw CLI::RequiredError("--output");
    }
    if (!options.is_exact) {
      fmt::print(
          stderr,
          "the light is traced for a new version; -o FILE.h5 has it carried over in seconds, "
          "for a file\n");
      options.is_exact = true;
    }
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
  const Recolored made = options.is_exact ? make_exactly(options, model, request)
                                          : make_carried(options, model, request);
  const double seconds = since_start.seconds();
  if (options.wants_json) {
    print_json(to_json(made, request, model.base.reference, options, seconds));
  } else {
    print_text(made, request, model.base.reference, options, seconds);
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
