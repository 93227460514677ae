#include "cli/recolor_report.h"

#include <cstdio>

#include <fmt/format.h>

#include "cli/colour_text.h"
#include "cli/progress.h"
#include "shading/colour_space.h"

namespace weft::cli {

namespace {

using Json = nlohmann::ordered_json;

Json colour_json(glm::dvec3 linear) {
  const glm::dvec3 lab = shading::lab_from_linear(linear);
  return {{"hex", hex_text(linear)},
          {"linear", {linear.x, linear.y, linear.z}},
          {"lab", {lab.x, lab.y, lab.z}}};
}

}  // namespace

nlohmann::ordered_json to_json(const Recolored& made, const ColourwayRequest& request,
                               const std::string& base, double seconds) {
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
            {"exact", made.is_exact},
            {"output", nullptr},
            {"version", nullptr},
            {"content_digest", nullptr},
            {"targets", targets},
            {"carried_over", nullptr},
            {"exposure", request.exposure},
            {"pictures", made.fit.pictures},
            {"seconds", seconds}};
  if (!made.output.empty()) {
    json["output"] = made.output;
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
                double seconds) {
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
  std::string what = made.version;
  if (!made.output.empty()) {
    what += (what.empty() ? "" : ", ") + made.output;
  }
  if (what.empty()) {
    what = "nothing was written";
  }
  const std::string content = made.digest.empty() ? "" : ", content " + made.digest.substr(0, 12);
  fmt::print("{}{}, in {}\n", what, content, format_duration(seconds));
}

}  // namespace weft::cli
