#include "fabric/description_check.h"

#include <cmath>
#include <map>
#include <set>

#include "core/error.h"
#include "core/stopping.h"
#include "fabric/draft.h"
#include "fabric/field_checker.h"
#include "fabric/ply.h"

namespace weft::fabric {
namespace {

template <class Messages>
std::vector<std::string> names_of(const Messages& messages) {
  std::vector<std::string> names;
  for (const auto& message : messages) {
    names.push_back(message.name());
  }
  return names;
}

void check_hairs(const FieldChecker& check, const v1::Hairs& hairs) {
  check.number("per_mm", hairs.per_mm(), {0, 1000});
  check.number("length_sd_mm", hairs.length_sd_mm(), {0, 100});
  check.number("reach_mm", hairs.reach_mm(), {0, 100});
  check.number("reach_sd_mm", hairs.reach_sd_mm(), {0, 100});
  check.number("sweep_deg", hairs.sweep_deg(), {-3600, 3600});
  check.number("sweep_sd_deg", hairs.sweep_sd_deg(), {0, 3600});
  if (hairs.per_mm() > 0) {
    check.needed("length_mm", hairs.length_mm(), {0, 100, true});
  } else {
    check.number("length_mm", hairs.length_mm(), {0, 100});
  }
}

void check_migration(const FieldChecker& check, const v1::Migration& migration) {
  check.number("r_min", migration.r_min(), {0, 1});
  check.number("r_max", migration.r_max(), {0, 1});
  check.number("rate", migration.rate(), {0, 100});
  check.number("density_power", migration.density_power(), {0, 100});
  check.number("core", migration.core(), {0, 0.99});
  if (migration.r_min() > migration.r_max()) {
    check.wrong("r_min", "r_min " + core::shortest(migration.r_min()) + " is above r_max " +
                             core::shortest(migration.r_max()) + "; exchange them");
  }
}

void check_yarn_numbers(const FieldChecker& check, const v1::Yarn& yarn) {
  check.number("plies", yarn.plies(), {1, 64});
  check.number("fibres_per_ply", yarn.fibres_per_ply(), {1, 10000});
  check.needed("yarn_radius_mm", yarn.yarn_radius_mm(), {0.0005, 20});
  // 0 stands for a default that the other numbers, which are wrong, did not give.
  if (yarn.yarn_radius_mm() > 0 && yarn.fibre_radius_mm() != 0) {
    check.number("fibre_radius_mm", yarn.fibre_radius_mm(), {0.00001, yarn.yarn_radius_mm()});
  }
  check.number("ply_twist_per_cm", yarn.ply_twist_per_cm(), {-1000, 1000});
  check.number("fibre_twist_per_cm", yarn.fibre_twist_per_cm(), {-1000, 1000});
  check.number("ply_aspect", yarn.ply_aspect(), {0.05, 1});
  check.number("flattening", yarn.flattening(), {0, 0.8});
  check_migration(check.at("migration"), yarn.migration());
  check_hairs(check.at("hairs"), yarn.hairs());
  const FieldChecker loops = check.at("loops");
  loops.number("per_mm", yarn.loops().per_mm(), {0, 1000});
  loops.number("reach_mm", yarn.loops().reach_mm(), {0, 100});
  loops.number("reach_sd_mm", yarn.loops().reach_sd_mm(), {0, 100});
}

void check_yarn(const FieldChecker& check, const v1::Yarn& yarn,
                const std::vector<std::string>& materials) {
  check.name("name", yarn.name());
  check.known("material", yarn.material(), materials, "material");
  core::Mistakes in_numbers;
  check_yarn_numbers(FieldChecker(in_numbers, ""), yarn);
  if (!in_numbers.empty()) {
    check_yarn_numbers(check, yarn);
    return;
  }
  v1::Exemplar all_fibres;
  all_fibres.set_fibre_share(1);
  try {
    (void)yarn_model(yarn, yarn.yarn_radius_mm(), all_fibres);
  } catch (const core::Error& error) {
    check.wrong("fibre_radius_mm", error.what());
  }
}

void check_colour(const FieldChecker& check, const std::string& field, bool has,
                  const v1::Rgb& rgb) {
  if (!has) {
    check.wrong(field, field + " is missing; give r, g and b from 0 to 1, or a preset");
    return;
  }
  const FieldChecker colour = check.at(field);
  colour.number("r", rgb.r(), {0, 1});
  colour.number("g", rgb.g(), {0, 1});
  colour.number("b", rgb.b(), {0, 1});
}

void check_material(const FieldChecker& check, const v1::Material& material) {
  check.name("name", material.name());
  check_colour(check, "c_r", material.has_c_r(), material.c_r());
  check_colour(check, "c_tt", material.has_c_tt(), material.c_tt());
  check.number("beta_r_deg", material.beta_r_deg(), {0.1, 90});
  check.number("beta_tt_deg", material.beta_tt_deg(), {0.1, 90});
  check.number("gamma_tt_deg", material.gamma_tt_deg(), {0.1, 180});
}

void check_matrix(const FieldChecker& check, const v1::Matrix& matrix) {
  for (int p = 0; p < matrix.rows_size(); ++p) {
    const std::string& row = matrix.rows(p);
    const std::size_t bad = row.find_first_not_of("X1.0");
    if (bad != std::string::npos) {
      check.at("rows", p).wrong("", "character " + std::to_string(bad + 1) + " of the row is " +
                                        core::in_quotes(row.substr(bad, 1)) +
                                        "; use X or 1 where the warp is on top, . or 0 elsewhere");
    }
    if (row.size() != matrix.rows(0).size()) {
      check.at("rows", p).wrong(
          "", "this row has " + std::to_string(row.size()) + " ends, the first has " +
                  std::to_string(matrix.rows(0).size()) + "; all rows need the same length");
    }
  }
}

void check_weave(const FieldChecker& check, const v1::Weave& weave,
                 const std::vector<std::string>& yarns, bool others_are_right) {
  check.needed("ends_per_cm", weave.ends_per_cm(), {0.1, 1000});
  check.needed("picks_per_cm", weave.picks_per_cm(), {0.1, 1000});
  const auto known = [&](const FieldChecker& at, const std::string& field,
                         const std::string& value) {
    if (!value.empty()) {
      at.known(field, value, yarns, "yarn");
    }
  };
  known(check, "warp_yarn", weave.warp_yarn());
  known(check, "weft_yarn", weave.weft_yarn());
  std::set<std::uint32_t> colours;
  for (int c = 0; c < weave.colour_yarns_size(); ++c) {
    const FieldChecker at = check.at("colour_yarns", c);
    const v1::ColourYarn& entry = weave.colour_yarns(c);
    if (!colours.insert(entry.colour()).second) {
      at.wrong("colour", "colour " + std::to_string(entry.colour()) +
                             " has an entry already; put both yarns into one");
    }
    known(at, "warp_yarn", entry.warp_yarn());
    known(at, "weft_yarn", entry.weft_yarn());
  }
  core::Mistakes in_matrix;
  check_matrix(FieldChecker(in_matrix, ""), weave.matrix());
  if (!in_matrix.empty()) {
    check_matrix(check.at("matrix"), weave.matrix());
  } else if (others_are_right) {
    try {
      (void)draft_of(weave);
    } catch (const core::Error& error) {
      check.wrong("", error.what());
    }
  }
}

void check_fibres(const FieldChecker& check, const v1::ExplicitFibres& given,
                  const std::vector<std::string>& materials) {
  check.needed("size_x_mm", given.size_x_mm(), {0.001, 1000});
  check.needed("size_y_mm", given.size_y_mm(), {0.001, 1000});
  if (given.fibres().empty()) {
    check.wrong("fibres", "fibres is empty; give at least one");
  }
  for (int f = 0; f < given.fibres_size(); ++f) {
    const FieldChecker at = check.at("fibres", f);
    const v1::ExplicitFibres::Fibre& fibre = given.fibres(f);
    at.known("material", fibre.material(), materials, "material");
    at.needed("radius_mm", fibre.radius_mm(), {0.0001, 20});
    if (fibre.points_mm_size() < 6 || fibre.points_mm_size() % 3 != 0) {
      at.wrong("points_mm", "points_mm has " + std::to_string(fibre.points_mm_size()) +
                                " numbers; x, y and z of at least two points are needed");
    }
    for (const double value : fibre.points_mm()) {
      if (!std::isfinite(value) || std::abs(value) > 10000) {
        at.wrong("points_mm", "points_mm has the number " + core::shortest(value) +
                                  "; numbers from -10000 to 10000 are needed");
        break;
      }
    }
  }
}

void check_structure(const FieldChecker& check, const v1::FabricDescription& description) {
  const std::vector<std::string> yarns = names_of(description.yarns());
  if (description.has_weave()) {
    core::Mistakes so_far;
    FieldChecker probe(so_far, "");
    check_weave(probe.at("weave"), description.weave(), yarns, false);
    check_weave(check.at("weave"), description.weave(), yarns, so_far.empty());
  } else if (description.has_yarn_curves()) {
    const FieldChecker at = check.at("yarn_curves");
    at.number("scale", description.yarn_curves().scale(), {0, 1e6, true});
    at.known("yarn", description.yarn_curves().yarn(), yarns, "yarn");
    if (description.yarn_curves().source_case() == v1::YarnCurves::SOURCE_NOT_SET) {
      at.wrong("", "the curves have no source; give a pyp_file");
    }
  } else if (description.has_explicit_fibres()) {
    check_fibres(check.at("explicit_fibres"), description.explicit_fibres(),
                 names_of(description.materials()));
  } else {
    check.wrong("",
                "the description has no structure; give a weave, yarn_curves or "
                "explicit_fibres");
  }
}

void check_settings(const FieldChecker& check, const v1::FabricDescription& description) {
  const v1::Exemplar& exemplar = description.exemplar();
  const FieldChecker tile = check.at("exemplar");
  tile.number("repeats_x", exemplar.repeats_x(), {1, 10000});
  tile.number("repeats_y", exemplar.repeats_y(), {1, 10000});
  tile.number("segment_length_radii", exemplar.segment_length_radii(), {0.5, 1000});
  tile.number("fibre_share", exemplar.fibre_share(), {0, 1, true});
  const v1::Precompute& settings = description.precompute();
  const FieldChecker at = check.at("precompute");
  if (!v1::Quality_IsValid(settings.quality())) {
    at.wrong("quality", "quality is unknown; use QUALITY_PREVIEW, QUALITY_PAPER or QUALITY_BEST");
  }
  if (!v1::TransferEstimator_IsValid(settings.transfer_estimator())) {
    at.wrong("transfer_estimator",
             "transfer_estimator is unknown; use TRANSFER_ESTIMATOR_EXIT or "
             "TRANSFER_ESTIMATOR_LIGHT");
  }
  at.number("sh_order", settings.sh_order(), {0, 5});
  at.number("cell_length_mfp", settings.cell_length_mfp(), {0.1, 1000});
  at.number("paths_per_cell", settings.paths_per_cell(), {1, 100000000});
  if (settings.has_target_standard_error()) {
    at.number("target_standard_error", settings.target_standard_error(), {0, 1, true});
    if (settings.paths_per_cell() > core::kMostStoppingPaths) {
      at.wrong("paths_per_cell", "paths_per_cell is " + std::to_string(settings.paths_per_cell()) +
                                     "; with a target_standard_error at most " +
                                     std::to_string(core::kMostStoppingPaths) + " are possible");
    }
  }
  at.number("visibility_resolution", settings.visibility_resolution(), {16, 256});
  if (settings.visibility_resolution() % 16 != 0) {
    at.wrong("visibility_resolution", "visibility_resolution is " +
                                          std::to_string(settings.visibility_resolution()) +
                                          "; a multiple of 16 is needed, such as 64 or 128");
  }
  at.number("pca_components", settings.pca_components(), {1, 256});
  at.number("pca_sample_segments", settings.pca_sample_segments(), {2, 65536});
  if (settings.pca_components() > settings.pca_sample_segments()) {
    at.wrong("pca_components", "pca_components is " + std::to_string(settings.pca_components()) +
                                   ", more than the pca_sample_segments; raise those");
  }
  at.number("sg_count", settings.sg_count(), {1, 512});
  at.number("sg_sharpness", settings.sg_sharpness(), {1, 100000});
  at.number("max_path_length", settings.max_path_length(), {1, 1000000});
}

// Names of a list that stand twice.
template <class Messages>
void check_unique(const FieldChecker& check, const std::string& field, const Messages& messages) {
  std::map<std::string, int> first;
  for (int i = 0; i < messages.size(); ++i) {
    const auto [place, fresh] = first.try_emplace(messages[i].name(), i);
    if (!fresh && !messages[i].name().empty()) {
      check.at(field, i).wrong("name", "the name " + core::in_quotes(messages[i].name()) +
                                           " is taken by " + field + "[" +
                                           std::to_string(place->second) + "]; give another");
    }
  }
}

}  // namespace

core::Mistakes check_fields(const v1::FabricDescription& description) {
  core::Mistakes mistakes;
  const FieldChecker check(mistakes, "");
  check.name("name", description.name());
  check_structure(check, description);
  const std::vector<std::string> materials = names_of(description.materials());
  for (int y = 0; y < description.yarns_size(); ++y) {
    check_yarn(check.at("yarns", y), description.yarns(y), materials);
  }
  for (int m = 0; m < description.materials_size(); ++m) {
    check_material(check.at("materials", m), description.materials(m));
  }
  check_unique(check, "yarns", description.yarns());
  check_unique(check, "materials", description.materials());
  check_settings(check, description);
  return mistakes;
}

}  // namespace weft::fabric
