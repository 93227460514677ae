#include "cli/render_report.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/error.h"
#include "render/drawing_channels.h"
#include "render/image.h"
#include "render/png.h"

namespace weft::cli {

namespace {

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions print;
  print.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, print);
  if (!status.ok()) {
    throw core::Error(core::Code::kInternal, "the scene cannot be written as JSON");
  }
  return json;
}

nlohmann::json triple(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

}  // namespace

std::map<std::string, std::string> picture_metadata(const v1::Scene& described,
                                                    const FabricShelf& shelf,
                                                    const render::Drawing& drawing) {
  nlohmann::json fabrics = nlohmann::json::object();
  for (const auto& [reference, loaded] : shelf.fabrics()) {
    fabrics[reference] = {{"name", loaded.name}, {"content_digest", loaded.content_digest}};
  }
  constexpr auto replace = nlohmann::json::error_handler_t::replace;  // a path may be no UTF-8
  return {{"weft.software", "weft 0.1.0"},
          {"weft.integrator", v1::Integrator_Name(described.integration().integrator())},
          {"weft.samples_per_pixel", std::to_string(described.picture().samples_per_pixel())},
          {"weft.seed", std::to_string(described.integration().seed())},
          {"weft.scene", json_of(described)},
          {"weft.fabrics", fabrics.dump(-1, ' ', false, replace)},
          {"weft.cloth_mean", triple(drawing.cloth_mean).dump()},
          {"weft.cloth_standard_error", triple(drawing.cloth_standard_error).dump()},
          {"weft.cloth_share", nlohmann::json(drawing.cloth_share).dump()}};
}

void write_pictures(const RenderOptions& options, render::LayerSet layers, render::Drawing& drawing,
                    const std::map<std::string, std::string>& attributes) {
  const render::ExrPixels pixels =
      options.floats ? render::ExrPixels::kFloat : render::ExrPixels::kHalf;
  drawing.image.attributes = attributes;
  render::attach_layers(drawing, layers);
  render::write_exr(options.out, drawing.image, pixels);
  if (!options.stderr_image.empty()) {
    drawing.standard_error.attributes = attributes;
    drawing.standard_error.attributes["weft.content"] = "standard error of each pixel";
    render::write_exr(options.stderr_image, drawing.standard_error, pixels);
  }
  if (!options.png.empty()) {
    const float exposure =
        options.exposure ? *options.exposure : render::automatic_exposure(drawing.image);
    render::write_png(options.png, drawing.image.width, drawing.image.height,
                      render::tone_mapped(drawing.image, exposure));
  }
}

void report_drawing(const RenderOptions& options, const v1::Scene& described,
                    const render::Drawing& drawing, double load_seconds, double draw_seconds) {
  if (options.wants_json) {
    print_json({{"picture", options.out},
                {"png", options.png.empty() ? nlohmann::json() : nlohmann::json(options.png)},
                {"width", drawing.image.width},
                {"height", drawing.image.height},
                {"samples_per_pixel", described.picture().samples_per_pixel()},
                {"integrator", v1::Integrator_Name(described.integration().integrator())},
                {"cloth_mean", triple(drawing.cloth_mean)},
                {"cloth_standard_error", triple(drawing.cloth_standard_error)},
                {"cloth_share", drawing.cloth_share},
                {"load_seconds", load_seconds},
                {"draw_seconds", draw_seconds}});
    return;
  }
  fmt::print("{}{}: {} x {}, {} samples a pixel\n", options.out,
             options.png.empty() ? "" : " and " + options.png, drawing.image.width,
             drawing.image.height, described.picture().samples_per_pixel());
  fmt::print("mean of the cloth {:.4g} {:.4g} {:.4g}, standard error {:.2g} {:.2g} {:.2g}\n",
             drawing.cloth_mean.x, drawing.cloth_mean.y, drawing.cloth_mean.z,
             drawing.cloth_standard_error.x, drawing.cloth_standard_error.y,
             drawing.cloth_standard_error.z);
  fmt::print("loaded in {}, drawn in {}\n", format_duration(load_seconds),
             format_duration(draw_seconds));
}

}  // namespace weft::cli
