#include "fabric/build.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "fabric/explicit_fibres.h"
#include "fabric/fibres.h"
#include "fabric/layout.h"
#include "fabric/relax.h"
#include "fabric/thread_path.h"

namespace weft::fabric {

namespace {

constexpr double kMebibyte = 1048576;

void refuse_if_too_large(const TileEstimate& estimate) {
  if (estimate.memory_bytes > kTileLimitBytes) {
    std::array<char, 400> text{};
    std::snprintf(text.data(), text.size(),
                  "the tile would have %.3g fibres, %.3g segments and need %.3g MiB, more than the "
                  "limit of %.0f MiB; crop the draft, repeat it less often, lower "
                  "exemplar.fibre_share or raise exemplar.segment_length_radii",
                  static_cast<double>(estimate.fibres), static_cast<double>(estimate.segments),
                  static_cast<double>(estimate.memory_bytes) / kMebibyte,
                  static_cast<double>(kTileLimitBytes) / kMebibyte);
    throw core::Error(core::Code::kResourceExhausted, text.data());
  }
}

void refuse_if_too_long(const YarnLayout& repeat) {
  std::uint64_t nodes = 0;
  for (const YarnCurve& curve : repeat.curves) {
    nodes += curve.nodes.size();
  }
  if (nodes > kRelaxedNodeLimit) {
    std::array<char, 300> text{};
    std::snprintf(text.data(), text.size(),
                  "one repeat has %zu threads and %.3g nodes on them, more than the %.3g that are "
                  "relaxed in reasonable time; crop the draft (weave.crop)",
                  repeat.curves.size(), static_cast<double>(nodes),
                  static_cast<double>(kRelaxedNodeLimit));
    throw core::Error(core::Code::kResourceExhausted, text.data());
  }
}

void refuse_if_overlapping(const RelaxReport& report) {
  if (report.overlap_share > kOverlapTolerance) {
    std::array<char, 300> text{};
    std::snprintf(
        text.data(), text.size(),
        "the yarns have no room: after %u iterations two of them still overlap by %.1f %% "
        "of the thinner one's radius (allowed: %.1f %%); use fewer threads per cm, "
        "thinner yarns or more flattening",
        report.iterations, 100 * report.overlap_share, 100 * kOverlapTolerance);
    throw core::Error(core::Code::kInvalidArgument, text.data());
  }
}

// Number of each curve among those of its role.
std::uint32_t next_index(std::map<Role, std::uint32_t>& counts, Role role) {
  return counts[role]++;
}

std::uint32_t material_index(Tile& tile, const std::string& name) {
  const auto found = std::find(tile.material_names.begin(), tile.material_names.end(), name);
  if (found == tile.material_names.end()) {
    tile.material_names.push_back(name);
    return static_cast<std::uint32_t>(tile.material_names.size() - 1);
  }
  return static_cast<std::uint32_t>(found - tile.material_names.begin());
}

void lay_threads(const v1::FabricDescription& description, const YarnLayout& layout, Tile& tile) {
  std::vector<std::optional<YarnModel>> models(static_cast<std::size_t>(description.yarns_size()));
  std::map<Role, std::uint32_t> counts;
  for (const YarnCurve& curve : layout.curves) {
    const v1::Yarn& yarn = description.yarns(static_cast<int>(curve.yarn));
    std::optional<YarnModel>& model = models[curve.yarn];
    if (!model) {
      model = yarn_model(yarn, curve.radius_mm, description.exemplar());
    }
    const ThreadPath path(curve, layout.size_mm);
    const auto thread = static_cast<std::uint32_t>(tile.threads.size());
    tile.threads.push_back({curve.yarn, curve.role, next_index(counts, curve.role)});
    lay_fibres({yarn, *model, path, description.exemplar().segment_length_radii(), curve.period,
                thread, material_index(tile, yarn.material()), description.seed()},
               tile);
  }
}

void bound_height(Tile& tile) {
  tile.z_min_mm = std::numeric_limits<float>::max();
  tile.z_max_mm = std::numeric_limits<float>::lowest();
  for (const Strand& strand : tile.strands) {
    for (std::uint32_t p = 0; p < strand.point_count; ++p) {
      const float z = tile.points_mm[strand.first_point + p].z;
      tile.z_min_mm = std::min(tile.z_min_mm, z - strand.radius_mm);
      tile.z_max_mm = std::max(tile.z_max_mm, z + strand.radius_mm);
    }
  }
}

}  // namespace

Tile build_tile(const v1::FabricDescription& description, const BuildOptions& options) {
  refuse_if_too_large(estimate_tile(description));
  Tile tile;
  for (const v1::Yarn& yarn : description.yarns()) {
    tile.yarn_names.push_back(yarn.name());
  }
  if (description.has_explicit_fibres()) {
    place_explicit_fibres(description, tile);
  } else {
    const glm::uvec2 repeats{description.exemplar().repeats_x(),
                             description.exemplar().repeats_y()};
    YarnLayout repeat = lay_out(description);
    refuse_if_too_long(repeat);
    const RelaxReport relaxed = relax(repeat);
    refuse_if_overlapping(relaxed);
    if (options.relaxed != nullptr) {
      *options.relaxed = relaxed;
    }
    const YarnLayout layout = repeat_layout(repeat, repeats);
    tile.size_mm = glm::vec2(layout.size_mm);
    tile.blocks = repeats;
    lay_threads(description, layout, tile);
    const UntangleReport moved = untangle(tile, options.most_threads);
    if (options.untangled != nullptr) {
      *options.untangled = moved;
    }
  }
  bound_height(tile);
  index_segments(tile);
  return tile;
}

}  // namespace weft::fabric
