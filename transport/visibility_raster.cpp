#include "transport/visibility_raster.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/check.h"
#include "transport/bake_point.h"
#include "transport/ball_regions.h"
#include "transport/capsule_shadow.h"
#include "transport/capsule_tree.h"
#include "transport/cover_mask.h"
#include "transport/wide.h"

namespace weft::transport {

namespace {

// Of large tiles, what is looked at next is rarely in the cache.
void prefetch(const void* from, std::size_t size_bytes) {
  constexpr std::size_t kLine = 64;
  for (std::size_t at = 0; at < size_bytes; at += kLine) {
    __builtin_prefetch(static_cast<const char*>(from) + at);
  }
}

// The picture of one segment while it is painted.
class Painter {
 public:
  Painter(const Scene& scene, const CapsuleTree& tree, const SphereGrid& grid,
          std::uint32_t segment)
      : scene_(scene),
        tree_(tree),
        grid_(grid),
        wide_(wide_is_available()),
        mask_(grid.resolution) {
    const BakePoint point = bake_point(scene, segment);
    eye_mm_ = point.position_mm;
    own_ = point.own;
  }

  // Blocks in square rings round the eye, near ones first, until none further out can add anything.
  CoverMask paint_all(const Checkpoint& checkpoint) {
    for (int ring = 0; !blind_ && !is_covered_beyond(ring); ++ring) {
      pass(checkpoint);
      for (int y = -ring; y <= ring && !blind_; ++y) {
        const int step = std::abs(y) == ring ? 1 : 2 * ring;
        for (int x = -ring; x <= ring && !blind_; x += step) {
          paint_block({x, y});
        }
      }
    }
    if (blind_) {
      mask_.cover_all();
    }
    return std::move(mask_);
  }

 private:
  // A node that waits to be looked into.
  struct Visit {
    std::uint32_t node;
    float distance2;
    ImageRegion region;
  };

  // Whether all pixels are covered that blocks of this ring or beyond could cover: those lie at
  // least so far away that the cloth's faces are within a band round the horizon.
  [[nodiscard]] bool is_covered_beyond(int ring) const {
    const auto n = static_cast<std::int32_t>(grid_.resolution);
    const double away = (ring - 1) * std::min(tree_.size_mm.x, tree_.size_mm.y) -
                        static_cast<double>(tree_.overhang_mm);
    if (away <= 0) {
      return !is_open_between(0, n - 1);
    }
    const double up = std::max(0.0, static_cast<double>(tree_.z_max_mm - eye_mm_.z));
    const double down = std::max(0.0, static_cast<double>(eye_mm_.z - tree_.z_min_mm));
    const double rows = grid_.resolution / std::numbers::pi;
    const double margin = 1e-3;  // rows
    const auto first = static_cast<std::int32_t>(
        std::ceil((std::numbers::pi / 2 - std::atan2(up, away)) * rows - 0.5 - margin));
    const auto last = static_cast<std::int32_t>(
        std::floor((std::numbers::pi / 2 + std::atan2(down, away)) * rows - 0.5 + margin));
    return !is_open_between(std::max(0, first), std::min(last, n - 1));
  }

  [[nodiscard]] bool is_open_between(std::int32_t first_row, std::int32_t last_row) const {
    return mask_.is_open({first_row, last_row, 0, static_cast<std::int32_t>(grid_.resolution) - 1});
  }

  void paint_block(glm::ivec2 block) {
    shift_mm_ = glm::vec3(static_cast<float>(block.x * tree_.size_mm.x),
                          static_cast<float>(block.y * tree_.size_mm.y), 0) -
                eye_mm_;
    shift_tiles_ = block * tree_.tiles;
    stack_.clear();
    stack_.push_back({0, 0, {}});
    for (bool is_root = true; !stack_.empty() && !blind_; is_root = false) {
      const Visit visit = stack_.back();
      stack_.pop_back();
      if (!is_root && !mask_.is_open(visit.region)) {
        continue;  // by what was painted since it was put aside
      }
      const TreeNode& node = tree_.nodes[visit.node];
      bound(node.balls_mm, shift_mm_, grid_.resolution, wide_, regions_);
      if (node.is_leaf) {
        paint_leaf(node);
      } else {
        put_aside(node);
      }
    }
  }

  // The node's children that may hide something, so that the nearest one is taken up first.
  void put_aside(const TreeNode& node) {
    const auto first_new = static_cast<std::ptrdiff_t>(stack_.size());
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const ImageRegion region = regions_.region(i);
      if (mask_.is_open(region)) {
        stack_.push_back({node.first + i, regions_.distance2[i], region});
        prefetch(&tree_.nodes[node.first + i], sizeof(TreeNode));
      }
    }
    std::sort(stack_.begin() + first_new, stack_.end(), [](const Visit& a, const Visit& b) {
      return a.distance2 != b.distance2 ? a.distance2 > b.distance2 : a.node > b.node;
    });
  }

  void paint_leaf(const TreeNode& node) {
    prefetch(&tree_.pieces[node.first], node.count * sizeof(Piece));
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const ImageRegion region = regions_.region(i);
      if (!mask_.is_open(region)) {
        continue;  // most end here in dense cloth
      }
      const Piece& piece = tree_.pieces[node.first + i];
      if (piece.copy.strand == own_.strand && is_own(piece)) {
        continue;
      }
      const SeenCapsule capsule{piece.start_mm + shift_mm_, piece.axis, piece.length_mm,
                                piece.radius_mm};
      if (is_whole(region) && holds_origin(capsule)) {
        blind_ = true;
        return;
      }
      paint(capsule, region, grid_, wide_, mask_);
    }
  }

  // As that of every ball that holds the eye.
  [[nodiscard]] bool is_whole(const ImageRegion& region) const {
    const auto last = static_cast<std::int32_t>(grid_.resolution) - 1;
    return region.first_row == 0 && region.last_row == last && region.first_column == 0 &&
           region.last_column == last;
  }

  [[nodiscard]] bool is_own(const Piece& piece) const {
    return scene_.seen_from({piece.copy.strand, piece.copy.tile_x + shift_tiles_.x,
                             piece.copy.tile_y + shift_tiles_.y},
                            {0, 0}) == own_;
  }

  const Scene& scene_;
  const CapsuleTree& tree_;
  const SphereGrid& grid_;
  bool wide_;
  glm::vec3 eye_mm_{0, 0, 0};
  StrandCopy own_;
  CoverMask mask_;
  std::vector<Visit> stack_;
  BallRegions regions_;  // of the node at hand
  bool blind_ = false;   // the eye is inside another fibre
  glm::vec3 shift_mm_{0, 0, 0};
  glm::ivec2 shift_tiles_{0, 0};
};

}  // namespace

struct VisibilityRaster::State {
  State(const Scene& scene_in, std::uint32_t resolution)
      : scene(scene_in), tree(scene_in), grid(resolution) {}
  const Scene& scene;
  CapsuleTree tree;
  SphereGrid grid;
};

VisibilityRaster::VisibilityRaster(const Scene& scene, std::uint32_t resolution) {
  CHECK_EQ(resolution % 8, 0U);
  CHECK_LE(resolution, kMaxMaskResolution);
  state_ = std::make_unique<State>(scene, resolution);
}

VisibilityRaster::~VisibilityRaster() = default;

std::vector<std::uint8_t> VisibilityRaster::bits(std::uint32_t segment,
                                                 const Checkpoint& checkpoint) const {
  Painter painter(state_->scene, state_->tree, state_->grid, segment);
  return painter.paint_all(checkpoint).open_pixels();
}

}  // namespace weft::transport
