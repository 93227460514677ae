#include "cli/make_colourway.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <google/protobuf/util/json_util.h>

#include "cli/colour_text.h"
#include "cli/order_levels.h"
#include "cli/traced_difference.h"
#include "coordinator/versions/carried_over.h"
#include "core/check.h"
#include "core/error.h"
#include "shading/colour_space.h"
#include "storage/light_tables.h"

namespace weft::cli {

namespace {

// The numbers that `dyed` rounded to, as a person writes them.
double five_digits(float value) { return std::round(static_cast<double>(value) * 1e5) / 1e5; }

void set_rgb(v1::Rgb& rgb, const glm::vec3& colour) {
  rgb.set_r(five_digits(colour.x));
  rgb.set_g(five_digits(colour.y));
  rgb.set_b(five_digits(colour.z));
}

ColourRatios no_correction(const ColourwayRequest& request) {
  return ColourRatios(request.targets.size(), glm::dvec3(1));
}

std::vector<shading::FibreBcsdf> bcsdfs_of(const std::vector<shading::FibreMaterial>& materials) {
  return {materials.begin(), materials.end()};
}

// Three digits: an estimate has no more.
double significant(double value) { return std::stod(fmt::format("{:.3g}", value)); }

std::string lightness_text(glm::dvec3 linear) {
  const glm::dvec3 lab = shading::lab_from_linear(linear);
  return fmt::format("{} (L* {:.1f}, a* {:.1f}, b* {:.1f})", hex_text(linear), lab.x, lab.y, lab.z);
}

std::string base_name(const ColourwaySource& base) {
  return base.is_published ? base.reference
                           : std::filesystem::path(base.reference).filename().string();
}

}  // namespace

ColourwayModel::ColourwayModel(const ColourwaySource& from, unsigned thread_count)
    : base(from),
      threads(thread_count),
      carrier(base.contents),
      response(base.contents.database, carrier, threads),
      tracer(base.contents.database, base.description, threads) {}

double own_exposure(const ColourwayModel& model) {
  std::vector<shading::FibreMaterial> white;
  for (const shading::FibreMaterial& material : model.base.contents.database.materials) {
    white.push_back(dyed(material, dye_of(material), glm::dvec3(1)));
  }
  const coordinator::OrderLevels levels =
      traced_levels(model.carrier.sums(white), {}, bcsdfs_of(white), model.tracer);
  glm::dvec3 shown(0);
  double seen = 0;
  for (const YarnColour& yarn : model.response.colours(white, model.carrier.sums(white, levels))) {
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

ColourFit fit_colourway(const ColourwayModel& model, const ColourwayRequest& request,
                        const coordinator::OrderLevels& levels,
                        const std::vector<glm::dvec3>& correction) {
  const auto measure = [&](const std::vector<shading::FibreMaterial>& dyed) {
    std::vector<glm::dvec3> shown = target_colours(
        request.targets, model.response.colours(dyed, model.carrier.sums(dyed, levels)));
    for (std::size_t t = 0; t < shown.size(); ++t) {
      shown[t] *= request.exposure * correction[t];
    }
    return shown;
  };
  return fit_colours({request.targets.begin(), request.targets.end()},
                     request.source->contents.database.materials, measure);
}

coordinator::OrderLevels levels_of_fit(const ColourwayModel& model,
                                       const ColourwayRequest& request) {
  constexpr int kTraces = 2;
  coordinator::OrderLevels levels;
  for (int i = 0; i < kTraces; ++i) {
    const std::vector<shading::FibreMaterial> materials =
        fit_colourway(model, request, levels, no_correction(request)).materials;
    levels = traced_levels(model.carrier.sums(materials, levels), levels, bcsdfs_of(materials),
                           model.tracer);
  }
  return levels;
}

void measure_fit(const ColourwayModel& model, const ColourwayRequest& request,
                 const storage::FabricDatabase& database, const ColourRatios& bias, ColourFit& fit,
                 ColourRatios& correction) {
  constexpr double kBlack = 1e-6;
  std::vector<glm::dvec3> shown =
      target_colours(request.targets, yarn_colours(database, request.exposure, model.threads));
  for (std::size_t t = 0; t < shown.size(); ++t) {
    shown[t] *= bias[t];
    correction[t] *= glm::max(shown[t], kBlack) / glm::max(fit.reached[t], kBlack);
    fit.reached[t] = shown[t];
    fit.delta_e[t] = shading::delta_e_2000(shading::lab_from_linear(request.targets[t].linear),
                                           shading::lab_from_linear(shown[t]));
  }
}

namespace {

// Of the materials of that name.
void set_colours(v1::FabricDescription& description, const std::string& name,
                 const shading::FibreMaterial& colours) {
  for (v1::Material& material : *description.mutable_materials()) {
    if (material.name() == name) {
      set_rgb(*material.mutable_c_r(), colours.c_r);
      set_rgb(*material.mutable_c_tt(), colours.c_tt);
    }
  }
}

}  // namespace

v1::FabricDescription recolored_description(const ColourwayRequest& request, const ColourFit& fit) {
  v1::FabricDescription description = request.source->description;
  description.set_name(request.name);
  const std::vector<std::string>& names = request.source->contents.database.material_names;
  for (const YarnTarget& target : request.targets) {
    for (const std::size_t m : target.materials) {
      set_colours(description, names[m], fit.materials[m]);
    }
  }
  return description;
}

namespace {

storage::RecolourableDatabase carried_contents(const ColourwayModel& model,
                                               const ColourwayRequest& request,
                                               const ColourFit& fit,
                                               const coordinator::CarriedSums& sums) {
  storage::RecolourableDatabase colourway{model.base.contents.database, {}};
  storage::FabricDatabase& database = colourway.database;
  coordinator::CarriedMatrices carried = model.carrier.matrices(sums);
  database.transfer = std::move(carried.transfer);
  database.transfer_se = std::move(carried.transfer_se);
  database.materials = fit.materials;
  database.c_s = storage::scattering_tables(fit.materials, database.sh_order);
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  CHECK(google::protobuf::util::MessageToJsonString(recolored_description(request, fit), &json,
                                                    options)
            .ok());
  database.description_json = std::move(json);
  return colourway;
}

}  // namespace

void check_reached(const ColourwayRequest& request, const ColourFit& fit) {
  constexpr std::uint64_t kFewPaths = 2048;  // fewer than a preview has
  const std::vector<std::uint64_t>& paths = request.source->contents.database.cell_paths;
  const bool has_few = *std::min_element(paths.begin(), paths.end()) < kFewPaths;
  for (std::size_t t = 0; t < request.targets.size() && !request.takes_nearest; ++t) {
    if (fit.delta_e[t] >= kPromisedDeltaE) {
      throw core::Error(
          core::Code::kInvalidArgument,
          fmt::format("yarn {} cannot show {} in this cloth: its fibres reflect from 0 to 1 of "
                      "light, and the nearest they get is {}, Delta E 2000 {:.1f}; ask for that, "
                      "take it with --nearest, or let more light on it with --exposure{}",
                      request.targets[t].label, hex_text(request.targets[t].linear),
                      lightness_text(fit.reached[t]), fit.delta_e[t],
                      has_few
                          ? "; of so few paths a cell that is a rough guess, so that it may help "
                            "to make the fabric with more (paths_per_cell)"
                          : ""));
    }
  }
}

CarriedColourway carry_colourway(const ColourwayModel& model, const ColourwayRequest& request,
                                 const ColourRatios& bias) {
  constexpr double kGoodDeltaE = 0.3;
  constexpr double kFarDeltaE = 3;  // light of such dyes says little of that of others
  constexpr int kMostRounds = 8;
  constexpr int kMostTraces = 3;
  const coordinator::OrderLevels levels = levels_of_fit(model, request);
  CarriedColourway best;
  std::optional<TracedDifference> difference;
  int traces = 0;
  ColourRatios correction = no_correction(request);
  std::vector<shading::FibreMaterial> last;
  for (int round = 0; round < kMostRounds; ++round) {
    CarriedColourway made;
    made.fit = fit_colourway(model, request, levels, correction);
    if (made.fit.materials == last && difference) {
      break;  // as near as the dyes get
    }
    last = made.fit.materials;
    const coordinator::CarriedSums sums = model.carrier.sums(made.fit.materials, levels);
    made.contents = carried_contents(model, request, made.fit, sums);
    if (!difference) {
      difference.emplace(made.contents.database, sums, bcsdfs_of(made.fit.materials), model.tracer);
      ++traces;
    }
    difference->mend(made.contents.database, sums);
    storage::round_as_written(made.contents.database);  // what is measured is what is kept
    measure_fit(model, request, made.contents.database,
                bias.empty() ? no_correction(request) : bias, made.fit, correction);
    if (made.fit.worst_delta_e() > kFarDeltaE && traces < kMostTraces) {
      difference.reset();
    }
    if (best.fit.materials.empty() || made.fit.worst_delta_e() < best.fit.worst_delta_e()) {
      best = std::move(made);
    }
    if (best.fit.worst_delta_e() < kGoodDeltaE) {
      break;
    }
  }
  check_reached(request, best.fit);
  best.error = check_carried(best.contents.database, bcsdfs_of(best.fit.materials), model.tracer);
  best.contents.recolouring.carried_over_json = coordinator::carried_over_json(
      {base_name(model.base), model.base.digest.hex(), significant(best.error.light),
       significant(best.error.light_noise), significant(best.error.matrix)});
  return best;
}

}  // namespace weft::cli
