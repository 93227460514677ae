#include "cli/render_report.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/print_json.h"
#include "cli/progress.h"

namespace weft::cli {

namespace {

nlohmann::json triple(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

nlohmann::json json_of(const WrittenPicture& picture, const std::string& integrator) {
  return {{"picture", picture.out},
          {"png", picture.png.empty() ? nlohmann::json() : nlohmann::json(picture.png)},
          {"width", picture.width},
          {"height", picture.height},
          {"samples_per_pixel", picture.samples_per_pixel},
          {"mean_samples", picture.mean_samples},
          {"integrator", integrator},
          {"cloth_mean", triple(picture.cloth_mean)},
          {"cloth_standard_error", triple(picture.cloth_standard_error)},
          {"cloth_share", picture.cloth_share},
          {"load_seconds", picture.load_seconds},
          {"draw_seconds", picture.draw_seconds},
          {"device", picture.device}};
}

void print_frames(const std::vector<WrittenPicture>& pictures) {
  for (const WrittenPicture& picture : pictures) {
    if (picture.was_there) {
      fmt::print("{}: was there\n", picture.out);
    } else {
      fmt::print("{}: mean of the cloth {:.4g} {:.4g} {:.4g}, drawn in {}\n", picture.out,
                 picture.cloth_mean.x, picture.cloth_mean.y, picture.cloth_mean.z,
                 format_duration(picture.load_seconds + picture.draw_seconds));
    }
  }
}

void print_picture(const WrittenPicture& picture) {
  const bool is_adaptive = !picture.was_there && picture.mean_samples < picture.samples_per_pixel;
  fmt::print("{}{}: {} x {}, {} samples a pixel{}\n", picture.out,
             picture.png.empty() ? "" : " and " + picture.png, picture.width, picture.height,
             picture.samples_per_pixel,
             is_adaptive ? fmt::format(" at most, {:.1f} in the mean", picture.mean_samples) : "");
  if (picture.was_there) {
    fmt::print("was there\n");
    return;
  }
  fmt::print("mean of the cloth {:.4g} {:.4g} {:.4g}, standard error {:.2g} {:.2g} {:.2g}\n",
             picture.cloth_mean.x, picture.cloth_mean.y, picture.cloth_mean.z,
             picture.cloth_standard_error.x, picture.cloth_standard_error.y,
             picture.cloth_standard_error.z);
  fmt::print("loaded in {}, drawn in {} by {}\n", format_duration(picture.load_seconds),
             format_duration(picture.draw_seconds),
             picture.device == "cpu" ? "the CPU" : picture.device);
}

}  // namespace

void report_pictures(const RenderOptions& options, const v1::Scene& scene,
                     const std::vector<WrittenPicture>& pictures) {
  const std::string integrator = v1::Integrator_Name(scene.integration().integrator());
  if (!options.wants_json) {
    if (scene.has_animation()) {
      print_frames(pictures);
    } else {
      print_picture(pictures.front());
    }
    return;
  }
  if (!scene.has_animation()) {
    print_json(json_of(pictures.front(), integrator));
    return;
  }
  nlohmann::json frames = nlohmann::json::array();
  for (const WrittenPicture& picture : pictures) {
    nlohmann::json json = json_of(picture, integrator);
    json["frame"] = picture.frame;
    json["was_there"] = picture.was_there;
    frames.push_back(json);
  }
  print_json({{"frames", frames}});
}

}  // namespace weft::cli
