#include "render/compare.h"

#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/output_file.h"
#include "cli/print_json.h"
#include "render/image.h"
#include "render/png.h"
#include "render/similarity.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Say how a picture differs from a reference of the same size.\n"
    "The difference picture is black where they agree, red where A is brighter, blue where it is\n"
    "darker.\n"
    "Example: weft compare precomputed.exr path.exr -o difference.png";

struct CompareOptions {
  std::string image;
  std::string reference;
  std::string out;
  std::string layer;
  std::optional<double> scale;
  bool wants_json = false;
};

nlohmann::json triple(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

nlohmann::json relative_errors(const render::Comparison& comparison) {
  nlohmann::json errors = nlohmann::json::array();
  for (const std::optional<double>& error : comparison.relative_mean_error) {
    errors.push_back(error ? nlohmann::json(*error) : nlohmann::json());
  }
  return errors;
}

std::string percent(const std::optional<double>& error) {
  return error ? fmt::format("{:+.2f} %", 100 * *error) : std::string("(reference is black)");
}

void run(const CompareOptions& options) {
  if (!options.out.empty()) {
    check_output_file(options.out);
  }
  const render::Image image = render::read_exr(options.image, options.layer);
  const render::Image reference = render::read_exr(options.reference, options.layer);
  const render::Comparison comparison = render::compare(image, reference);
  const double similarity = render::structural_similarity(image, reference);
  const double scale = options.scale ? *options.scale : render::natural_scale(image, reference);
  if (!options.out.empty()) {
    render::write_png(options.out, image.width, image.height,
                      render::difference_picture(image, reference, scale));
  }
  if (options.wants_json) {
    print_json({{"rmse", comparison.rmse_all},
                {"rmse_per_channel", triple(comparison.rmse)},
                {"structural_similarity", similarity},
                {"mean", triple(comparison.mean)},
                {"reference_mean", triple(comparison.reference_mean)},
                {"relative_mean_error", relative_errors(comparison)},
                {"largest_difference", triple(comparison.largest_difference)},
                {"pixels", comparison.pixels},
                {"non_finite_pixels", comparison.non_finite_pixels},
                {"difference_picture",
                 options.out.empty() ? nlohmann::json() : nlohmann::json(options.out)},
                {"difference_full_scale", scale}});
    return;
  }
  fmt::print("RMSE {:.6g} (R {:.6g}, G {:.6g}, B {:.6g})\n", comparison.rmse_all, comparison.rmse.x,
             comparison.rmse.y, comparison.rmse.z);
  fmt::print("relative error of the mean: R {}, G {}, B {}\n",
             percent(comparison.relative_mean_error[0]), percent(comparison.relative_mean_error[1]),
             percent(comparison.relative_mean_error[2]));
  fmt::print("structural similarity as displayed: {:.4f}\n", similarity);
  if (comparison.non_finite_pixels > 0) {
    fmt::print("{} pixels that are not finite were left out\n", comparison.non_finite_pixels);
  }
  if (!options.out.empty()) {
    fmt::print("{}: full red or blue is a difference of {:.4g}\n", options.out, scale);
  }
}

}  // namespace

void add_compare(CLI::App& app) {
  auto options = std::make_shared<CompareOptions>();  // shared: the callback outlives this function
  CLI::App* command = add_command(app, "compare", kHelp);
  command->add_option("image", options->image, "Picture A (.exr)")->required();
  command->add_option("reference", options->reference, "Picture B, the reference (.exr)")
      ->required();
  command->add_option("-o,--output", options->out, "Difference picture to write (.png)");
  command->add_option("--layer", options->layer,
                      "Compare a layer of both, such as single or multiple");
  command
      ->add_option("--scale", options->scale,
                   "Difference that is shown full; default: what one pixel in a hundred exceeds")
      ->check(CLI::PositiveNumber);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
