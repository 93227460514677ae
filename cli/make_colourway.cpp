#include "cli/make_colourway.h"

#include <cmath>
#include <filesystem>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <google/protobuf/util/json_util.h>

#include "cli/carried_over.h"
#include "coordinator/versions/carry_over.h"
#include "core/check.h"
#include "core/error.h"
#include "shading/colour_space.h"

namespace weft::cli {

namespace {

// The numbers that `dyed` rounded to, as a person writes them.
double five_digits(float value) { return std::round(static_cast<double>(value) * 1e5) / 1e5; }

void set_rgb(v1::Rgb& rgb, const glm::vec3& colour) {
  rgb.set_r(five_digits(colour.x));
  rgb.set_g(five_digits(colour.y));
  rgb.set_b(five_digits(colour.z));
}

// Three digits: an estimate has no more.
double significant(double value) { return std::stod(fmt::format("{:.3g}", value)); }

std::string base_name(const ColourwaySource& base) {
  return base.is_published ? base.reference
                           : std::filesystem::path(base.reference).filename().string();
}

}  // namespace

double own_exposure(const storage::RecolourableDatabase& base, const SwatchResponse& response) {
  std::vector<shading::FibreMaterial> white;
  for (const shading::FibreMaterial& material : base.database.materials) {
    white.push_back(dyed(material, dye_of(material), glm::dvec3(1)));
  }
  glm::dvec3 shown(0);
  double seen = 0;
  for (const YarnColour& yarn :
       response.colours(white, coordinator::carried_matrices(base, white).transfer)) {
    shown += yarn.share * yarn.linear;
    seen += yarn.share;
  }
  const double mean = (shown.x + shown.y + shown.z) / 3;
  if (!(mean > 0)) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "nothing of the cloth is seen from above, so that its colours cannot be "
                      "measured");
  }
  return significant(seen / mean);
}

ColourFit fit_colourway(const ColourwayRequest& request, const SwatchResponse& response,
                        const std::vector<glm::dvec3>& correction) {
  const auto measure = [&](const std::vector<shading::FibreMaterial>& dyed) {
    std::vector<glm::dvec3> shown = target_colours(
        request.targets,
        response.colours(dyed,
                         coordinator::carried_matrices(request.base->contents, dyed).transfer));
    for (std::size_t t = 0; t < shown.size(); ++t) {
      shown[t] *= request.exposure * correction[t];
    }
    return shown;
  };
  return fit_colours({request.targets.begin(), request.targets.end()},
                     request.source->contents.database.materials, measure);
}

void measure_fit(const ColourwayRequest& request, const storage::FabricDatabase& database,
                 ColourFit& fit, std::vector<glm::dvec3>& correction) {
  constexpr double kBlack = 1e-6;
  const std::vector<glm::dvec3> shown =
      target_colours(request.targets, yarn_colours(database, request.exposure, request.threads));
  for (std::size_t t = 0; t < shown.size(); ++t) {
    correction[t] *= glm::max(shown[t], kBlack) / glm::max(fit.reached[t], kBlack);
    fit.reached[t] = shown[t];
    fit.delta_e[t] = shading::delta_e_2000(shading::lab_from_linear(request.targets[t].linear),
                                           shading::lab_from_linear(shown[t]));
  }
}

v1::FabricDescription recolored_description(const ColourwayRequest& request, const ColourFit& fit) {
  v1::FabricDescription description = request.source->description;
  description.set_name(request.name);
  const std::vector<std::string>& names = request.base->contents.database.material_names;
  for (const YarnTarget& target : request.targets) {
    for (const std::size_t m : target.materials) {
      for (v1::Material& material : *description.mutable_materials()) {
        if (material.name() == names[m]) {
          set_rgb(*material.mutable_c_r(), fit.materials[m].c_r);
          set_rgb(*material.mutable_c_tt(), fit.materials[m].c_tt);
        }
      }
    }
  }
  return description;
}

storage::RecolourableDatabase carried_colourway(const ColourwayRequest& request,
                                                const ColourFit& fit) {
  storage::RecolourableDatabase colourway = request.base->contents;
  coordinator::carry_over(colourway, fit.materials);
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  CHECK(google::protobuf::util::MessageToJsonString(recolored_description(request, fit), &json,
                                                    options)
            .ok());
  colourway.database.description_json = std::move(json);
  return colourway;
}

CarryError state_origin(const ColourwayRequest& request, storage::RecolourableDatabase& colourway) {
  const CarryError error = check_carried(colourway.database, request.base->description);
  colourway.recolouring.carried_over_json = carried_over_json(
      {base_name(*request.base), request.base->digest.hex(), significant(error.light),
       significant(error.light_noise), significant(error.matrix)});
  return error;
}

}  // namespace weft::cli
