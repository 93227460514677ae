#include "fabric/explicit_fibres.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <glm/geometric.hpp>

#include "core/error.h"
#include "fabric/fibres.h"

namespace weft::fabric {

namespace {

using Fibre = v1::ExplicitFibres::Fibre;

[[noreturn]] void refuse(int index, const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument,
                    "explicit fibre " + std::to_string(index) + " " + what);
}

glm::dvec3 point_of(const Fibre& fibre, int p) {
  return {fibre.points_mm(3 * p), fibre.points_mm(3 * p + 1), fibre.points_mm(3 * p + 2)};
}

void check(const Fibre& fibre, int index, glm::dvec2 size_mm) {
  const int numbers = fibre.points_mm_size();
  if (numbers < 6 || numbers % 3 != 0) {
    refuse(index,
           "has " + std::to_string(numbers) + " coordinates; give x, y, z of at least two points");
  }
  for (const double value : fibre.points_mm()) {
    if (!std::isfinite(value)) {
      refuse(index, "has a coordinate that is not finite; give numbers in millimetres");
    }
  }
  if (!(fibre.radius_mm() > 0) || !std::isfinite(fibre.radius_mm())) {
    refuse(index, "has no radius; give a positive number of millimetres");
  }
  if (fibre.period_x() != 0 || fibre.period_y() != 0) {
    const glm::dvec3 period{fibre.period_x() * size_mm.x, fibre.period_y() * size_mm.y, 0};
    const glm::dvec3 miss = point_of(fibre, numbers / 3 - 1) - point_of(fibre, 0) - period;
    if (glm::length(miss) > fibre.radius_mm()) {
      refuse(index, "does not end where its period says: it misses by " +
                        std::to_string(glm::length(miss)) +
                        " mm; its last point must be its first one moved by whole tiles");
    }
  }
}

// The fibre as a curve over its own tile, so that joining is the same as for yarns. The last point
// of a periodic fibre is its first one again and is left out.
YarnCurve as_curve(const Fibre& fibre) {
  YarnCurve curve;
  curve.role = Role::kExplicit;
  curve.period = {fibre.period_x(), fibre.period_y()};
  const bool open = curve.period == glm::ivec2(0, 0);
  const int count = fibre.points_mm_size() / 3 - (open ? 0 : 1);
  for (int p = 0; p < count; ++p) {
    curve.nodes.push_back({point_of(fibre, p), fibre.radius_mm(), fibre.radius_mm()});
  }
  return curve;
}

}  // namespace

void place_explicit_fibres(const v1::FabricDescription& description, Tile& tile) {
  const v1::ExplicitFibres& source = description.explicit_fibres();
  if (source.fibres_size() == 0) {
    throw core::Error(core::Code::kInvalidArgument,
                      "explicit_fibres has no fibre; give at least one");
  }
  YarnLayout layout;
  layout.size_mm = {source.size_x_mm(), source.size_y_mm()};
  for (int f = 0; f < source.fibres_size(); ++f) {
    const Fibre& fibre = source.fibres(f);
    check(fibre, f, layout.size_mm);
    layout.curves.push_back(as_curve(fibre));
    layout.curves.back().yarn = static_cast<std::uint32_t>(f);
  }
  tile.blocks = {description.exemplar().repeats_x(), description.exemplar().repeats_y()};
  layout = repeat_layout(layout, tile.blocks);
  tile.size_mm = glm::vec2(layout.size_mm);
  tile.yarn_names = {"explicit"};
  for (const YarnCurve& curve : layout.curves) {
    const Fibre& fibre = source.fibres(static_cast<int>(curve.yarn));
    const auto found =
        std::find(tile.material_names.begin(), tile.material_names.end(), fibre.material());
    const auto material = static_cast<std::uint32_t>(found - tile.material_names.begin());
    if (found == tile.material_names.end()) {
      tile.material_names.push_back(fibre.material());
    }
    const auto first = static_cast<std::uint32_t>(tile.points_mm.size());
    for (const YarnNode& node : curve.nodes) {
      tile.points_mm.emplace_back(node.centre_mm);
    }
    if (fibre.period_x() != 0 || fibre.period_y() != 0) {
      tile.points_mm.push_back(period_end(tile.points_mm[first], curve.period, tile.size_mm));
    }
    const auto points = static_cast<std::uint32_t>(tile.points_mm.size()) - first;
    const auto thread = static_cast<std::uint32_t>(tile.threads.size());
    tile.threads.push_back({0, Role::kExplicit, thread});
    tile.strands.push_back({first, points, material, thread, static_cast<float>(fibre.radius_mm()),
                            curve.period.x, curve.period.y});
  }
}

TileEstimate estimate_explicit_fibres(const v1::FabricDescription& description) {
  const double copies =
      static_cast<double>(description.exemplar().repeats_x()) * description.exemplar().repeats_y();
  double points = 0;
  double fibres = 0;
  for (const Fibre& fibre : description.explicit_fibres().fibres()) {
    points += copies * fibre.points_mm_size() / 3;
    fibres += copies;
  }
  TileEstimate estimate;
  const double most = 1e18;
  estimate.fibres = static_cast<std::uint64_t>(std::min(fibres, most));
  estimate.segments = static_cast<std::uint64_t>(std::clamp(points - fibres, 0.0, most));
  estimate.memory_bytes = static_cast<std::uint64_t>(
      std::min(points * (sizeof(glm::vec3) + sizeof(std::uint32_t) + sizeof(YarnNode)) +
                   fibres * (sizeof(Strand) + sizeof(Thread)),
               most));
  return estimate;
}

}  // namespace weft::fabric
