// What noise costs the path integrator: the variance of a sample of a pixel over the picture's mean
// brightness squared, times the CPU time of a sample; one thread, a row of a Markdown table for
// each fabric and light (docs/performance.md). Two builds are compared by their last columns.
//   cmake --build build --target bench_path_variance
//   build/bin/bench_path_variance out/gabardine.h5 examples/silk_plain.textproto

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <glm/geometric.hpp>

#include "render/draw.h"
#include "render/flat_cloth.h"
#include "render/load_fabric.h"
#include "render/path_integrator.h"
#include "render/scene.h"

namespace weft::render {
namespace {

struct Options {
  std::vector<std::string> fabrics;
  std::vector<std::string> lights{"directional", "SG 50", "SG 10"};
  std::uint32_t side = 64;
  std::uint32_t samples = 64;
  std::uint32_t runs = 4;
  double repeats = 1.5;  // of the weave, that the picture is high
  bool local = false;
};

struct Spread {
  double mean = 0;
  double error = 0;
};

Spread spread_of(const std::vector<double>& values) {
  const auto count = static_cast<double>(values.size());
  Spread spread;
  for (const double value : values) {
    spread.mean += value / count;
  }
  for (const double value : values) {
    spread.error += (value - spread.mean) * (value - spread.mean) / (count * (count - 1));
  }
  spread.error = std::sqrt(spread.error);
  return spread;
}

// Empty where light_of() knows the light.
std::string light_problem(const std::string& name) {
  char* end = nullptr;
  const bool sharp = name.rfind("SG ", 0) == 0 && std::strtod(name.c_str() + 3, &end) > 0;
  return name == "directional" || (sharp && *end == '\0')
             ? ""
             : "no light \"" + name + "\": say directional or, say, \"SG 50\"";
}

// 40 degrees from the normal, on the other side than the eye.
Light light_of(const std::string& name) {
  const glm::dvec3 towards = glm::normalize(glm::dvec3(0.45, -0.45, 0.76));
  if (name == "directional") {
    return DirectionalLight{towards, glm::vec3(1)};
  }
  return SgLight{towards, std::stod(name.substr(3)), glm::vec3(1), true};
}

// Endless cloth over black, seen from 30 degrees.
Scene scene_of(const std::shared_ptr<const Fabric>& fabric, const Options& options) {
  Scene scene;
  FlatPlacement placement;
  placement.size_mm = glm::dvec2(fabric->tile().size_mm);
  placement.endless = true;
  placement.black_underlay = true;
  scene.cloths.push_back(make_flat_cloth(fabric, placement));
  Camera::View view;
  view.position_mm = 100.0 * glm::dvec3(-0.3, 0.4, 0.866);
  view.perspective = false;
  const fabric::Tile& tile = fabric->tile();
  const double block_mm = static_cast<double>(tile.size_mm.y) / static_cast<double>(tile.blocks.y);
  view.height = options.repeats * block_mm;
  scene.camera = Camera(view, 1.0);
  return scene;
}

// Of a sample: its mean variance over the pixels and channels, over the mean squared.
double relative_variance(const Drawing& drawing, double samples) {
  double variance = 0;
  double mean = 0;
  for (std::size_t i = 0; i < drawing.image.pixels.size(); ++i) {
    const glm::vec3 error = drawing.standard_error.pixels[i];
    variance += static_cast<double>(glm::dot(error, error)) * samples;
    const glm::vec3 value = drawing.image.pixels[i];
    mean += static_cast<double>(value.x + value.y + value.z);
  }
  const double count = 3 * static_cast<double>(drawing.image.pixels.size());
  return variance / count / std::pow(mean / count, 2);
}

void print_row(const std::string& fabric, const std::string& light, const Scene& scene,
               const Options& options) {
  PathSettings path;
  path.local = options.local;
  const PathIntegrator integrator(scene, path);
  DrawSettings settings;
  settings.width = settings.height = options.side;
  settings.samples_per_pixel = options.samples;
  settings.threads = 1;
  std::vector<double> seconds;
  std::vector<double> variances;
  std::vector<double> costs;
  std::vector<double> means;
  const double rays = std::pow(options.side, 2) * options.samples;
  for (std::uint32_t run = 0; run < options.runs; ++run) {
    settings.seed = run + 1;
    const std::clock_t start = std::clock();
    const Drawing drawing = draw(
        scene.camera, integrator, settings, [](double) {}, [] { return false; });
    seconds.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / rays);
    variances.push_back(relative_variance(drawing, options.samples));
    costs.push_back(1e6 * seconds.back() * variances.back());
    means.push_back((drawing.cloth_mean.x + drawing.cloth_mean.y + drawing.cloth_mean.z) / 3);
  }
  const Spread cost = spread_of(costs);
  const Spread mean = spread_of(means);
  std::printf("| %s | %s | %.5f ± %.5f | %.2f | %.3g | %.3g ± %.2g |\n", fabric.c_str(),
              light.c_str(), mean.mean, mean.error, 1e6 * spread_of(seconds).mean,
              spread_of(variances).mean, cost.mean, cost.error);
  std::fflush(stdout);
}

void bench(const Options& options) {
  std::printf(
      "| fabric | light | mean | µs a sample | variance of a sample | variance x µs |\n"
      "|---|---|---|---|---|---|\n");
  for (const std::string& path : options.fabrics) {
    const LoadedFabric fabric = load_fabric(path, Fabric::Wanted::kFibres);
    Scene scene = scene_of(fabric.fabric, options);
    for (const std::string& light : options.lights) {
      scene.lights.assign(1, light_of(light));
      print_row(fabric.name, light, scene, options);
    }
  }
}

}  // namespace
}  // namespace weft::render

int main(int argc, char** argv) {
  weft::render::Options options;
  CLI::App app("Variance of the path integrator times its CPU time.");
  app.add_option("fabrics", options.fabrics, "databases or descriptions")->required();
  app.add_option("--lights", options.lights, "directional, or SG and its sharpness: \"SG 50\"")
      ->check(weft::render::light_problem);
  app.add_option("--side", options.side, "pixels")->check(CLI::PositiveNumber);
  app.add_option("--samples", options.samples, "of a pixel")->check(CLI::Range(2U, 1U << 20));
  app.add_option("--runs", options.runs, "with other seeds")->check(CLI::Range(2U, 1000U));
  app.add_option("--repeats", options.repeats, "of the weave, that the picture is high")
      ->check(CLI::PositiveNumber);
  app.add_flag("--local", options.local, "paths end where they leave the cloth");
  CLI11_PARSE(app, argc, argv);
  try {
    weft::render::bench(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
