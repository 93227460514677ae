#include "fabric/description_defaults.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "fabric/build.h"
#include "fabric/ply.h"

namespace weft::fabric {
namespace {

// Turns per centimetre that put a helix of this radius at an angle to its axis.
double turns_per_cm(double angle_deg, double radius_mm) {
  if (!(radius_mm > 0)) {
    return 0;
  }
  const double angle = angle_deg * std::numbers::pi / 180;
  return 10 * std::tan(angle) / (2 * std::numbers::pi * radius_mm);
}

template <class T>
void fill(T& message, bool (T::*has)() const, void (T::*set)(double), double value) {
  if (!(message.*has)()) {
    (message.*set)(value);
  }
}

void expand_yarn(v1::Yarn& yarn) {
  if (yarn.plies() == 0) {
    yarn.set_plies(kDefaultPlies);
  }
  if (yarn.fibres_per_ply() == 0) {
    yarn.set_fibres_per_ply(kDefaultFibresPerPly);
  }
  const double radius_mm = yarn.yarn_radius_mm();
  fill(yarn, &v1::Yarn::has_ply_aspect, &v1::Yarn::set_ply_aspect, 1);
  if (yarn.fibre_radius_mm() == 0 && yarn.ply_aspect() > 0 && yarn.ply_aspect() <= 1) {
    const PlySection ply = ply_section(yarn.plies(), yarn.ply_aspect());
    const double share = kDefaultPacking * ply.radial * ply.tangential / yarn.fibres_per_ply();
    yarn.set_fibre_radius_mm(radius_mm * std::sqrt(share));
  }
  const double ply_radius_mm = yarn.plies() > 1 ? radius_mm / 2 : radius_mm;
  const double ply_twist = yarn.plies() > 1 ? turns_per_cm(kDefaultPlyAngleDeg, radius_mm) : 0;
  fill(yarn, &v1::Yarn::has_ply_twist_per_cm, &v1::Yarn::set_ply_twist_per_cm, ply_twist);
  fill(yarn, &v1::Yarn::has_fibre_twist_per_cm, &v1::Yarn::set_fibre_twist_per_cm,
       -turns_per_cm(kDefaultFibreAngleDeg, ply_radius_mm));
  fill(yarn, &v1::Yarn::has_flattening, &v1::Yarn::set_flattening, 0.3);
  v1::Migration& migration = *yarn.mutable_migration();
  using Migration = v1::Migration;
  fill(migration, &Migration::has_r_min, &Migration::set_r_min, 0.85);
  fill(migration, &Migration::has_r_max, &Migration::set_r_max, 1);
  fill(migration, &Migration::has_rate, &Migration::set_rate, 1);
  fill(migration, &Migration::has_density_power, &Migration::set_density_power, 0.4);
  fill(migration, &Migration::has_core, &Migration::set_core, 0);
  fill(*yarn.mutable_hairs(), &v1::Hairs::has_per_mm, &v1::Hairs::set_per_mm, 0);
  fill(*yarn.mutable_loops(), &v1::Loops::has_per_mm, &v1::Loops::set_per_mm, 0);
}

void expand_material(v1::Material& material) {
  const auto widen = [&](double value, void (v1::Material::*set)(double), double otherwise) {
    if (value == 0) {
      (material.*set)(otherwise);
    }
  };
  widen(material.beta_r_deg(), &v1::Material::set_beta_r_deg, 5);
  widen(material.beta_tt_deg(), &v1::Material::set_beta_tt_deg, 10);
  widen(material.gamma_tt_deg(), &v1::Material::set_gamma_tt_deg, 25);
}

void expand_precompute(v1::Precompute& settings) {
  if (settings.quality() == v1::QUALITY_UNSPECIFIED) {
    settings.set_quality(v1::QUALITY_PAPER);
  }
  if (settings.transfer_estimator() == v1::TRANSFER_ESTIMATOR_UNSPECIFIED) {
    settings.set_transfer_estimator(v1::TRANSFER_ESTIMATOR_EXIT);
  }
  const auto count = [&](bool has, void (v1::Precompute::*set)(std::uint32_t),
                         std::uint32_t value) {
    if (!has) {
      (settings.*set)(value);
    }
  };
  using Settings = v1::Precompute;
  count(settings.has_sh_order(), &Settings::set_sh_order, 5);
  const bool is_by_exit = settings.transfer_estimator() == v1::TRANSFER_ESTIMATOR_EXIT;
  count(settings.has_paths_per_cell(), &Settings::set_paths_per_cell, is_by_exit ? 4096 : 50000);
  count(settings.has_visibility_resolution(), &Settings::set_visibility_resolution, 128);
  count(settings.has_pca_components(), &Settings::set_pca_components, 48);
  count(settings.has_pca_sample_segments(), &Settings::set_pca_sample_segments, 4096);
  count(settings.has_sg_count(), &Settings::set_sg_count, 48);
  count(settings.has_max_path_length(), &Settings::set_max_path_length, 10000);
  fill(settings, &Settings::has_cell_length_mfp, &Settings::set_cell_length_mfp, 1);
  fill(settings, &Settings::has_sg_sharpness, &Settings::set_sg_sharpness, 64);
}

// Lengthens segments, then lowers fibre_share until the tile has about kPreviewSegments. Fewer
// fibres of the same cover are thicker by the root of the share, and so are their segments longer:
// segments go with its power 3/2, as far as every ply keeps its fibres and every fibre its bends.
void thin_for_preview(v1::FabricDescription& description) {
  constexpr double kLeastShare = 0.001;
  constexpr int kMostSteps = 4;
  constexpr double kLongSegment = 6;
  v1::Exemplar& exemplar = *description.mutable_exemplar();
  std::uint64_t segments = estimate_tile(description).segments;
  if (segments > kPreviewSegments * 11 / 10) {
    exemplar.set_segment_length_radii(std::max(exemplar.segment_length_radii(), kLongSegment));
    segments = estimate_tile(description).segments;
  }
  for (int step = 0; step < kMostSteps && segments > kPreviewSegments * 11 / 10; ++step) {
    const double before = exemplar.fibre_share();
    const double excess = static_cast<double>(segments) / kPreviewSegments;
    exemplar.set_fibre_share(std::max(kLeastShare, before * std::pow(excess, -2.0 / 3)));
    try {
      segments = estimate_tile(description).segments;
    } catch (const core::Error&) {
      exemplar.set_fibre_share(before);  // so few fibres are too thick for their plies
      break;
    }
  }
}

}  // namespace

void expand_defaults(v1::FabricDescription& description) {
  for (v1::Yarn& yarn : *description.mutable_yarns()) {
    expand_yarn(yarn);
  }
  for (v1::Material& material : *description.mutable_materials()) {
    expand_material(material);
  }
  if (description.has_yarn_curves() && description.yarn_curves().scale() == 0) {
    description.mutable_yarn_curves()->set_scale(1000);
  }
  v1::Exemplar& exemplar = *description.mutable_exemplar();
  exemplar.set_repeats_x(std::max(1U, exemplar.repeats_x()));
  exemplar.set_repeats_y(std::max(1U, exemplar.repeats_y()));
  if (exemplar.segment_length_radii() == 0) {
    exemplar.set_segment_length_radii(kDefaultSegmentLengthRadii);
  }
  if (exemplar.fibre_share() == 0) {
    exemplar.set_fibre_share(1);
  }
  expand_precompute(*description.mutable_precompute());
}

void apply_quality(v1::FabricDescription& description) {
  v1::Precompute& settings = *description.mutable_precompute();
  v1::Exemplar& exemplar = *description.mutable_exemplar();
  if (settings.quality() == v1::QUALITY_PREVIEW) {
    settings.set_paths_per_cell(std::min(settings.paths_per_cell(), 2048U));
    settings.set_visibility_resolution(std::min(settings.visibility_resolution(), 128U));
    settings.set_pca_sample_segments(std::min(settings.pca_sample_segments(), 1024U));
    settings.set_cell_length_mfp(std::max(settings.cell_length_mfp(), 2.5));
    exemplar.set_repeats_x(std::min(exemplar.repeats_x(), 2U));
    exemplar.set_repeats_y(std::min(exemplar.repeats_y(), 2U));
    thin_for_preview(description);
  } else if (settings.quality() == v1::QUALITY_BEST) {
    settings.set_sh_order(std::max(settings.sh_order(), 5U));
    settings.set_paths_per_cell(std::max(settings.paths_per_cell(), 16384U));
    settings.set_visibility_resolution(std::max(settings.visibility_resolution(), 128U));
    settings.set_pca_sample_segments(std::max(settings.pca_sample_segments(), 4096U));
    settings.set_pca_components(std::max(settings.pca_components(), 64U));
    settings.set_cell_length_mfp(std::min(settings.cell_length_mfp(), 1.0));
    exemplar.set_segment_length_radii(std::min(exemplar.segment_length_radii(), 4.0));
  }
}

void check_size(const v1::FabricDescription& description) {
  const TileEstimate tile = estimate_tile(description);
  if (tile.memory_bytes > kTileLimitBytes) {
    throw core::Error(core::Code::kResourceExhausted,
                      "the tile would have " + std::to_string(tile.fibres) + " fibres and " +
                          std::to_string(tile.segments) + " segments and need " +
                          std::to_string((tile.memory_bytes >> 20) + 1) + " MiB, the limit is " +
                          std::to_string(kTileLimitBytes >> 20) +
                          " MiB; crop the draft (weave.crop), repeat it less often, or lower "
                          "exemplar.fibre_share");
  }
}

}  // namespace weft::fabric
