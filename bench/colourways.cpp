// bench_colourways: light that colourways carry over, against a full recomputation
// (docs/colourways.md).

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "cli/colour_text.h"
#include "cli/local_run.h"
#include "cli/make_colourway.h"
#include "cli/split_materials.h"
#include "core/error.h"
#include "core/program.h"
#include "core/resource_use.h"
#include "fabric/description.h"
#include "shading/colour_space.h"
#include "storage/fabric_database.h"

namespace {

using namespace weft;

struct Options {
  std::vector<std::string> descriptions;
  std::vector<std::vector<std::string>> colourways;
  std::filesystem::path folder = "out/colourways";
  unsigned threads = 2;
};

struct Differences {
  double light = 0;       // relative, of all cells' together, in the channel where it is largest
  double light_rms = 0;   // root mean square of cells' differences, over that of cells' light
  double matrix_rms = 0;  // of all coefficients, in the same way
  double noise = 0;       // of the traced coefficients
};

Differences difference_between(const storage::FabricDatabase& carried,
                               const storage::FabricDatabase& traced) {
  const std::size_t cells = traced.cell_paths.size();
  const std::size_t entries = traced.transfer.size() / (3 * cells);
  std::array<double, 3> sum_carried{};
  std::array<double, 3> sum_traced{};
  double light = 0;
  double light_difference = 0;
  double matrix = 0;
  double matrix_difference = 0;
  double noise = 0;
  for (std::size_t i = 0; i < traced.transfer.size(); ++i) {
    const double is = carried.transfer[i];
    const double should_be = traced.transfer[i];
    const double error = traced.transfer_se[i];
    matrix += should_be * should_be;
    matrix_difference += (is - should_be) * (is - should_be);
    noise += error * error;
    if (i % entries == 0) {
      const std::size_t channel = i / entries % 3;
      sum_carried[channel] += is;
      sum_traced[channel] += should_be;
      light += should_be * should_be;
      light_difference += (is - should_be) * (is - should_be);
    }
  }
  Differences result;
  for (std::size_t c = 0; c < 3; ++c) {
    const double difference = sum_carried[c] / sum_traced[c] - 1;
    result.light = std::abs(difference) > std::abs(result.light) ? difference : result.light;
  }
  result.light_rms = std::sqrt(light_difference / light);
  result.matrix_rms = std::sqrt(matrix_difference / matrix);
  result.noise = std::sqrt(noise / matrix);
  return result;
}

storage::FabricDatabase run(const v1::FabricDescription& description, const Options& options,
                            const std::string& name) {
  cli::ResultCache cache(options.folder / (description.name() + ".cache"));
  const cli::LocalRunHooks hooks{[](const std::vector<cli::StageProgress>&) {},
                                 [] { return false; }};
  const std::filesystem::path path = options.folder / name;
  (void)cli::run_locally(description, options.threads, cache, path, hooks);
  return storage::read_database(path);
}

void compare(const cli::ColourwayModel& model, const std::vector<std::string>& yarns,
             const Options& options) {
  if (!cli::material_splits(yarns, model.base.contents.database).empty()) {
    throw core::Error(core::Code::kInvalidArgument,
                      "yarns of one material are asked for different colours; take a fabric whose "
                      "yarns have materials of their own");
  }
  cli::ColourwayRequest request;
  request.source = &model.base;
  request.targets = cli::colour_targets(yarns, model.base.contents.database);
  request.name = model.base.description.name();
  request.takes_nearest = true;
  request.exposure = cli::own_exposure(model);
  std::string asked;
  for (const std::string& yarn : yarns) {
    asked += (asked.empty() ? "" : " ") + yarn;
  }
  const double began = core::process_cpu_seconds();
  const cli::CarriedColourway made = cli::carry_colourway(model, request);
  const double seconds = core::process_cpu_seconds() - began;
  const storage::FabricDatabase traced =
      run(cli::recolored_description(request, made.fit), options, request.name + "_traced.h5");
  const std::vector<glm::dvec3> shown = cli::target_colours(
      request.targets, cli::yarn_colours(traced, request.exposure, options.threads));
  double delta_e = 0;
  double channel = 0;  // of a picture, where it is furthest off
  for (std::size_t t = 0; t < shown.size(); ++t) {
    const glm::dvec3 lab = shading::lab_from_linear(shown[t]);
    for (int c = 0; c < 3; ++c) {
      const double off = made.fit.reached[t][c] / shown[t][c] - 1;
      channel = std::abs(off) > std::abs(channel) ? off : channel;
    }
    delta_e = std::max(delta_e,
                       shading::delta_e_2000(shading::lab_from_linear(made.fit.reached[t]), lab));
  }
  const Differences found = difference_between(made.contents.database, traced);
  fmt::print(
      "| {} | {} | {:.2f} | {:.2f} | {:+.1f} % | {:+.1f} % | {:.1f} % | {:.0f} % | {:.0f} % "
      "| {:.1f} |\n",
      request.name, asked, made.fit.worst_delta_e(), delta_e, 100 * channel, 100 * found.light,
      100 * found.light_rms, 100 * found.matrix_rms, 100 * found.noise, seconds);
  std::fflush(stdout);
}

void compare_all(const Options& options) {
  std::filesystem::create_directories(options.folder);
  fmt::print(
      "| fabric | asked for | asked to shown | shown to traced | worst channel | light | "
      "light by cell | matrices | noise | CPU s |\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const std::string& path : options.descriptions) {
    const v1::FabricDescription description = fabric::load_description(path, v1::QUALITY_PREVIEW);
    const std::string name = description.name() + ".h5";
    (void)run(description, options, name);
    const cli::ColourwaySource source =
        cli::open_colourway_source((options.folder / name).string(), {});
    const cli::ColourwayModel model(source, options.threads);
    for (const std::vector<std::string>& yarns : options.colourways) {
      compare(model, yarns, options);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  std::vector<std::string> colourways;
  CLI::App app("Colourways by carried-over light, against the same fibres traced.");
  app.add_option("description", options.descriptions, "Fabric descriptions")->required();
  app.add_option("--colours", colourways,
                 "A colourway, as for 'weft recolor --yarn', with commas between yarns: "
                 "'warp=#7a1f2b,weft=#102040'; as often as needed")
      ->allow_extra_args(false)
      ->required();
  app.add_option("--folder", options.folder, "Where databases and finished work go");
  app.add_option("--threads", options.threads);
  return core::run_program(app, argc, argv, [&] {
    for (const std::string& colourway : colourways) {
      options.colourways.push_back(CLI::detail::split(colourway, ','));
    }
    compare_all(options);
    return 0;
  });
}
