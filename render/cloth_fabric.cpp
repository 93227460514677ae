#include "render/cloth_fabric.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/check.h"
#include "core/error.h"
#include "render/ray.h"

namespace weft::render {
namespace {

// Blocks that a line may cross: a level one in endless cloth would never end.
constexpr int kMostBlocks = 1 << 20;
constexpr double kSameSize = 1e-5;

glm::dvec2 block_of(const fabric::Tile& tile) {
  return glm::dvec2(tile.size_mm) / glm::dvec2(tile.blocks);
}

// The first fibre of one endless fabric.
std::optional<FlatHit> closest_in_endless(const transport::Scene& scene, const glm::dvec3& start_mm,
                                          const glm::dvec3& way_mm,
                                          const std::optional<transport::StrandCopy>& ignored) {
  const double length_mm = glm::length(way_mm);
  if (!(length_mm > 0)) {
    return std::nullopt;
  }
  // Wrapped in double before it becomes float: far from the origin nothing is lost.
  const glm::dvec2 size(scene.tile().size_mm);
  const glm::dvec2 tile = glm::floor(glm::dvec2(start_mm) / size);
  const glm::vec3 origin(glm::dvec3(glm::dvec2(start_mm) - tile * size, start_mm.z));
  const glm::ivec2 own_tile = glm::ivec2(tile) + scene.tile_of(origin);
  std::optional<transport::StrandCopy> seen;
  if (ignored) {
    seen = scene.seen_from(*ignored, own_tile);
  }
  const std::optional<transport::Hit> hit =
      scene.closest(origin, glm::vec3(way_mm / length_mm), static_cast<float>(length_mm), seen);
  if (!hit) {
    return std::nullopt;
  }
  return FlatHit{static_cast<double>(hit->t_mm) / length_mm, hit->segment,
                 scene.seen_from(hit->copy, -own_tile), 0};
}

// Along one axis: the block a line is in, and the share of the line at which it leaves it.
struct Crossing {
  std::int64_t block;
  std::int64_t step;
  double next;
  double width;  // shares that a block takes

  Crossing(double start_mm, double way_mm, double block_mm)
      : block(static_cast<std::int64_t>(std::floor(start_mm / block_mm))),
        step(way_mm < 0 ? -1 : 1),
        next(kInfinity),
        width(kInfinity) {
    if (way_mm != 0) {
      const auto border = static_cast<double>(block + (way_mm > 0 ? 1 : 0)) * block_mm;
      next = (border - start_mm) / way_mm;
      width = block_mm / std::fabs(way_mm);
    }
  }
  void go_on() {
    block += step;
    next += width;
  }
};

}  // namespace

std::uint32_t BlockPattern::at(std::int64_t i, std::int64_t j) const {
  const auto wrapped = [](std::int64_t value, std::uint32_t count) {
    const std::int64_t rest = value % static_cast<std::int64_t>(count);
    return static_cast<std::size_t>(rest < 0 ? rest + count : rest);
  };
  return fabric[wrapped(j, height) * width + wrapped(i, width)];
}

ClothFabric::ClothFabric(std::shared_ptr<const Fabric> fabric) : fabrics_{std::move(fabric)} {
  CHECK(fabrics_.front() != nullptr);
  low_mm_ = static_cast<double>(fabrics_.front()->tile().z_min_mm);
  high_mm_ = static_cast<double>(fabrics_.front()->tile().z_max_mm);
}

ClothFabric::ClothFabric(std::vector<std::shared_ptr<const Fabric>> fabrics, BlockPattern pattern)
    : fabrics_(std::move(fabrics)), pattern_(std::move(pattern)) {
  CHECK(!fabrics_.empty());
  CHECK(pattern_->width > 0 && pattern_->height > 0);
  CHECK_EQ(pattern_->fabric.size(), std::size_t{pattern_->width} * pattern_->height);
  CHECK(*std::max_element(pattern_->fabric.begin(), pattern_->fabric.end()) < fabrics_.size());
  pattern_->block_mm = block_of(fabrics_.front()->tile());
  low_mm_ = kInfinity;
  high_mm_ = -kInfinity;
  for (std::size_t k = 0; k < fabrics_.size(); ++k) {
    const fabric::Tile& tile = fabrics_[k]->tile();
    low_mm_ = std::min(low_mm_, static_cast<double>(tile.z_min_mm));
    high_mm_ = std::max(high_mm_, static_cast<double>(tile.z_max_mm));
    const glm::dvec2 first = pattern_->block_mm;
    const glm::dvec2 block = block_of(tile);
    const glm::dvec2 difference = glm::abs(block - first);
    if (difference.x > kSameSize * first.x || difference.y > kSameSize * first.y) {
      throw core::Error(
          core::Code::kInvalidArgument,
          fmt::format("the blocks of a pattern's fabrics differ in size: {:.6g} x {:.6g} mm in "
                      "fabric 0, {:.6g} x {:.6g} mm in fabric {}; give fabrics whose weave repeats "
                      "after as many ends and picks, with the same ends_per_cm and picks_per_cm",
                      first.x, first.y, block.x, block.y, k));
    }
  }
}

std::optional<FlatHit> ClothFabric::closest_of(std::uint32_t fabric, const glm::dvec3& start_mm,
                                               const glm::dvec3& way_mm,
                                               const std::optional<FlatStart>& from) const {
  std::optional<transport::StrandCopy> ignored;
  if (from && from->fabric == fabric) {
    ignored = from->copy;
  }
  std::optional<FlatHit> hit =
      closest_in_endless(fabrics_[fabric]->scene(), start_mm, way_mm, ignored);
  if (hit) {
    hit->fabric = fabric;
  }
  return hit;
}

// From block to block; those of one fabric in a row are one piece of the line.
std::optional<FlatHit> ClothFabric::closest(const glm::dvec3& start_mm, const glm::dvec3& way_mm,
                                            const std::optional<FlatStart>& from) const {
  if (!pattern_) {
    return closest_of(0, start_mm, way_mm, from);
  }
  Crossing across(start_mm.x, way_mm.x, pattern_->block_mm.x);
  Crossing along(start_mm.y, way_mm.y, pattern_->block_mm.y);
  double begin = 0;
  std::uint32_t fabric = pattern_->at(across.block, along.block);
  for (int step = 0; step < kMostBlocks; ++step) {
    Crossing& first = across.next < along.next ? across : along;
    const double end = std::min(first.next, 1.0);
    const bool is_last = !(first.next < 1);
    first.go_on();
    const std::uint32_t next = pattern_->at(across.block, along.block);
    if (!is_last && next == fabric) {
      continue;
    }
    std::optional<FlatHit> hit =
        closest_of(fabric, start_mm + begin * way_mm, (end - begin) * way_mm, from);
    if (hit) {
      hit->share = begin + hit->share * (end - begin);
      return hit;
    }
    if (is_last) {
      break;
    }
    begin = end;
    fabric = next;
  }
  return std::nullopt;
}

}  // namespace weft::render
