#include "render/gpu/fabric_grid.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <glm/geometric.hpp>

#include "core/check.h"
#include "core/error.h"
#include "render/gpu/capsule_voxels.h"

namespace weft::render::gpu {
namespace {

using shading::DeviceCapsule;
using shading::kBrickEdge;
using shading::kBrickVoxels;

static_assert(sizeof(DeviceCapsule) == 32);
static_assert(sizeof(shading::DeviceFabric) == 68 &&
              offsetof(shading::DeviceFabric, first_nearest) == 64);
static_assert(kBrickVoxels == kBrickEdge * kBrickEdge * kBrickEdge);

// By which capsules are taken to be larger when they are put into voxels, in voxels: more than what
// the kernels' arithmetic loses.
constexpr double kMarginVoxels = 0.01;

struct Bounds {
  double low_mm = 1e30;
  double high_mm = -1e30;
  double least_radius_mm = 1e30;
};

Bounds bounds_of(const fabric::Tile& tile) {
  Bounds bounds;
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const fabric::Segment s = tile.segment(k);
    const auto radius = static_cast<double>(s.radius_mm);
    bounds.low_mm = std::min(bounds.low_mm, std::min<double>(s.a_mm.z, s.b_mm.z) - radius);
    bounds.high_mm = std::max(bounds.high_mm, std::max<double>(s.a_mm.z, s.b_mm.z) + radius);
    bounds.least_radius_mm = std::min(bounds.least_radius_mm, radius);
  }
  return bounds;
}

// The voxel edge at which a voxel among straight fibres lies within reach of `wanted` of them: a
// cube of edge h is hit by 1.5 h^2 lines per unit of their length in a unit of volume (Crofton),
// and fibres of radius r reach about 0.8 r farther to each side.
double voxel_for(const fabric::Tile& tile, const Bounds& bounds, double wanted) {
  double length = 0;
  double weighted_radius = 0;
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const fabric::Segment s = tile.segment(k);
    const double own =
        static_cast<double>(glm::distance(s.a_mm, s.b_mm)) + 2 * static_cast<double>(s.radius_mm);
    length += own;
    weighted_radius += own * static_cast<double>(s.radius_mm);
  }
  const double radius = weighted_radius / length;
  const double volume = static_cast<double>(tile.size_mm.x) * static_cast<double>(tile.size_mm.y) *
                        (bounds.high_mm - bounds.low_mm);
  const double across = std::sqrt(wanted * volume / (1.5 * length));
  return std::clamp(across - 1.6 * radius, radius, 32 * radius);
}

// Whole bricks each way, as near to `voxel_mm` as they come.
VoxelFrame frame_of(const fabric::Tile& tile, const Bounds& bounds, double voxel_mm) {
  VoxelFrame frame;
  // Fibres that touch the lowest and the highest plane lie within it.
  const double slack = 1e-3 * (bounds.high_mm - bounds.low_mm);
  frame.low_mm = {0, 0, bounds.low_mm - slack};
  const glm::dvec3 size(glm::dvec2(tile.size_mm), bounds.high_mm - bounds.low_mm + 2 * slack);
  for (int axis = 0; axis < 3; ++axis) {
    const double bricks = std::round(size[axis] / (kBrickEdge * voxel_mm));
    frame.voxels[axis] = kBrickEdge * static_cast<int>(std::clamp(bricks, 1.0, 1e5));
    frame.voxel_mm[axis] = size[axis] / frame.voxels[axis];
  }
  return frame;
}

DeviceCapsule packed(const TileCapsule& capsule) {
  const glm::dvec3 half = 0.5 * (capsule.b_mm - capsule.a_mm);
  const double length = glm::length(half);
  return {glm::vec3(0.5 * (capsule.a_mm + capsule.b_mm)), static_cast<float>(capsule.radius_mm),
          length > 0 ? glm::vec3(half / length) : glm::vec3(1, 0, 0), static_cast<float>(length)};
}

// Puts capsules into the voxels of one frame.
class Filler {
 public:
  Filler(const VoxelFrame& frame, const std::vector<TileCapsule>& capsules)
      : frame_(frame),
        capsules_(capsules),
        bricks_(frame.voxels / kBrickEdge),
        half_diagonal_mm_(0.5 * glm::length(frame.voxel_mm)),
        margin_mm_(kMarginVoxels *
                   std::max({frame.voxel_mm.x, frame.voxel_mm.y, frame.voxel_mm.z})) {}

  // Finds the occupied bricks. Returns false when there would be more entries than `most`.
  bool count(FabricGrid& grid, std::uint64_t most) const {
    const auto brick_count = static_cast<std::size_t>(bricks_.x) *
                             static_cast<std::size_t>(bricks_.y) *
                             static_cast<std::size_t>(bricks_.z);
    grid.bricks.assign(brick_count, -1);
    std::uint64_t entries = 0;
    std::int32_t voxels = 0;
    for (std::size_t i = 0; i < capsules_.size() && entries <= most; ++i) {
      for_each(capsules_[i], [&](const glm::ivec3& voxel) {
        ++entries;
        std::int32_t& first = grid.bricks[brick_of(voxel)];
        if (first < 0) {
          first = voxels;
          voxels += kBrickVoxels;
        }
      });
    }
    grid.voxels.assign(static_cast<std::size_t>(voxels) + 1, 0);
    return entries <= most;
  }

  // REQUIRES: count() returned true.
  void fill(FabricGrid& grid) const {
    for (const TileCapsule& capsule : capsules_) {
      for_each(capsule, [&](const glm::ivec3& voxel) { ++grid.voxels[place_of(grid, voxel)]; });
    }
    std::uint32_t sum = 0;
    for (std::uint32_t& voxel : grid.voxels) {  // now the end of each voxel's entries
      sum += voxel;
      voxel = sum;
    }
    grid.entries.resize(sum);
    for (std::size_t i = capsules_.size(); i > 0; --i) {
      for_each(capsules_[i - 1], [&](const glm::ivec3& voxel) {
        grid.entries[--grid.voxels[place_of(grid, voxel)]] = static_cast<std::uint32_t>(i - 1);
      });
    }
  }

 private:
  template <class Visit>
  void for_each(const TileCapsule& capsule, const Visit& visit) const {
    const double reach = capsule.radius_mm + margin_mm_;
    visit_voxels(frame_, capsule, reach, [&](const glm::ivec3& voxel, const glm::dvec3& centre) {
      if (distance_from_axis(capsule, centre) <= reach + half_diagonal_mm_) {
        visit(voxel);
      }
    });
  }

  [[nodiscard]] std::size_t brick_of(const glm::ivec3& voxel) const {
    const glm::ivec3 brick = voxel / kBrickEdge;
    return static_cast<std::size_t>(brick.x + bricks_.x * (brick.y + bricks_.y * brick.z));
  }

  [[nodiscard]] std::size_t place_of(const FabricGrid& grid, const glm::ivec3& voxel) const {
    const glm::ivec3 in_brick = voxel % kBrickEdge;
    return static_cast<std::size_t>(
        grid.bricks[brick_of(voxel)] +
        (in_brick.x + kBrickEdge * (in_brick.y + kBrickEdge * in_brick.z)));
  }

  const VoxelFrame& frame_;
  const std::vector<TileCapsule>& capsules_;
  glm::ivec3 bricks_;
  double half_diagonal_mm_;
  double margin_mm_;
};

}  // namespace

std::uint64_t FabricGrid::size_bytes() const {
  return sizeof(fabric) + bricks.size() * sizeof(bricks[0]) + voxels.size() * sizeof(voxels[0]) +
         entries.size() * sizeof(entries[0]) + capsules.size() * sizeof(capsules[0]) +
         segments.size() * sizeof(segments[0]);
}

FabricGrid build_fabric_grid(const fabric::Tile& tile, const GridSettings& settings) {
  CHECK_GT(tile.segment_count(), 0U);
  const Bounds bounds = bounds_of(tile);
  double voxel_mm = voxel_for(tile, bounds, settings.capsules_per_voxel);
  const std::vector<TileCapsule> capsules =
      capsules_in_tile(tile, 2 * kMarginVoxels * std::max<double>(tile.size_mm.x, tile.size_mm.y));
  FabricGrid grid;
  for (const TileCapsule& capsule : capsules) {
    grid.capsules.push_back(packed(capsule));
    grid.segments.push_back(capsule.segment);
  }
  const std::uint64_t fibres_bytes = grid.size_bytes();
  // Voxels grow until the grid fits; 40 times is a factor of 10,000.
  for (int attempt = 0; attempt < 40; ++attempt, voxel_mm *= 1.26) {
    const VoxelFrame frame = frame_of(tile, bounds, voxel_mm);
    const Filler filler(frame, capsules);
    const double bricks = static_cast<double>(frame.voxels.x / kBrickEdge) *
                          (frame.voxels.y / kBrickEdge) * (frame.voxels.z / kBrickEdge);
    const double left =
        static_cast<double>(settings.most_bytes) - static_cast<double>(fibres_bytes) - 4 * bricks;
    if (left <= 0 || !filler.count(grid, static_cast<std::uint64_t>(left / 4)) ||
        grid.size_bytes() > settings.most_bytes) {
      continue;
    }
    filler.fill(grid);
    if (grid.size_bytes() > settings.most_bytes) {
      grid.entries.clear();
      continue;
    }
    grid.fabric.size_mm = tile.size_mm;
    grid.fabric.blocks = glm::ivec2(tile.blocks);
    grid.fabric.z_low_mm = static_cast<float>(frame.low_mm.z);
    grid.fabric.z_high_mm = static_cast<float>(frame.low_mm.z + frame.voxels.z * frame.voxel_mm.z);
    grid.fabric.voxel_mm = glm::vec3(frame.voxel_mm);
    grid.fabric.bricks = frame.voxels / kBrickEdge;
    return grid;
  }
  throw core::Error(core::Code::kResourceExhausted,
                    "a grid of " + std::to_string(capsules.size()) + " fibre segments needs more " +
                        "than " + std::to_string(settings.most_bytes >> 20) +
                        " MiB; use a smaller exemplar or longer segments");
}

}  // namespace weft::render::gpu
