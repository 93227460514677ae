#include "transport/visibility_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include "core/check.h"
#include "transport/bake_point.h"
#include "transport/capsule_shadow.h"
#include "transport/capsule_tree.h"
#include "transport/cover_mask.h"

namespace weft::transport {

namespace {

// The picture of one segment while it is painted.
class Painter {
 public:
  Painter(const Scene& scene, const CapsuleTree& tree, const SphereGrid& grid,
          std::uint32_t segment)
      : scene_(scene), tree_(tree), grid_(grid), mask_(grid.resolution) {
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
      cover_everything();
    }
    return std::move(mask_);
  }

 private:
  static constexpr std::size_t kMaxStack = 128;

  // Whether all pixels are covered that blocks of this ring or beyond could cover: those lie at
  // least so far away that the cloth's faces are within a band round the horizon.
  [[nodiscard]] bool is_covered_beyond(int ring) const {
    const double away = (ring - 1) * std::min(tree_.size_mm.x, tree_.size_mm.y) -
                        static_cast<double>(tree_.overhang_mm);
    if (away <= 0) {
      return mask_.is_all_covered();
    }
    const double up = std::max(0.0, static_cast<double>(tree_.z_max_mm - eye_mm_.z));
    const double down = std::max(0.0, static_cast<double>(eye_mm_.z - tree_.z_min_mm));
    const double rows = grid_.resolution / std::numbers::pi;
    const double margin = 1e-3;  // rows
    const auto first = static_cast<std::int32_t>(
        std::ceil((std::numbers::pi / 2 - std::atan2(up, away)) * rows - 0.5 - margin));
    const auto last = static_cast<std::int32_t>(
        std::floor((std::numbers::pi / 2 + std::atan2(down, away)) * rows - 0.5 + margin));
    return mask_.next_open_row(std::max(0, first),
                               std::min(last, static_cast<std::int32_t>(grid_.resolution) - 1)) < 0;
  }

  void paint_block(glm::ivec2 block) {
    shift_mm_ = glm::vec3(static_cast<float>(block.x * tree_.size_mm.x),
                          static_cast<float>(block.y * tree_.size_mm.y), 0) -
                eye_mm_;
    shift_tiles_ = block * tree_.tiles;
    std::array<std::uint32_t, kMaxStack> stack{};
    std::size_t depth = 0;
    stack[depth++] = 0;
    while (depth > 0 && !blind_) {
      const TreeNode& node = tree_.nodes[stack[--depth]];
      if (!find_open_region(node.centre_mm + shift_mm_, node.radius_mm, mask_, region_)) {
        continue;
      }
      if (node.count > 0) {
        paint_leaf(node);
        continue;
      }
      CHECK_LT(depth + 2, kMaxStack);
      const bool swap = distance2(node.first + 1) < distance2(node.first);
      stack[depth++] = swap ? node.first : node.first + 1;  // the nearer one is popped first
      stack[depth++] = swap ? node.first + 1 : node.first;
    }
  }

  [[nodiscard]] float distance2(std::uint32_t node) const {
    const glm::vec3 off = tree_.nodes[node].centre_mm + shift_mm_;
    return glm::dot(off, off);
  }

  void paint_leaf(const TreeNode& node) {
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Piece& piece = tree_.pieces[i];
      if (piece.copy.strand == own_.strand && is_own(piece)) {
        continue;
      }
      const SeenCapsule capsule{piece.start_mm + shift_mm_, piece.axis, piece.length_mm,
                                piece.radius_mm};
      if (holds_origin(capsule)) {
        blind_ = true;
        return;
      }
      const glm::vec3 centre = capsule.start + 0.5f * capsule.length * capsule.axis;
      const float reach = 0.5f * capsule.length + capsule.radius;
      if (find_open_region(centre, reach, mask_, region_)) {
        paint(capsule, region_, grid_, mask_);
      }
    }
  }

  [[nodiscard]] bool is_own(const Piece& piece) const {
    return scene_.seen_from({piece.copy.strand, piece.copy.tile_x + shift_tiles_.x,
                             piece.copy.tile_y + shift_tiles_.y},
                            {0, 0}) == own_;
  }

  void cover_everything() {
    for (std::uint32_t r = 0; r < grid_.resolution; ++r) {
      std::fill_n(mask_.row(r), mask_.words(), ~std::uint64_t{0});
    }
  }

  const Scene& scene_;
  const CapsuleTree& tree_;
  const SphereGrid& grid_;
  glm::vec3 eye_mm_{0, 0, 0};
  StrandCopy own_;
  CoverMask mask_;
  ImageRegion region_;  // scratch
  bool blind_ = false;  // the eye is inside another fibre
  glm::vec3 shift_mm_{0, 0, 0};
  glm::ivec2 shift_tiles_{0, 0};
};

}  // namespace

struct VisibilityRaster::State {
  explicit State(const Scene& scene_in) : scene(scene_in), tree(scene_in) {}
  const Scene& scene;
  CapsuleTree tree;
};

VisibilityRaster::VisibilityRaster(const Scene& scene) : state_(std::make_unique<State>(scene)) {}

VisibilityRaster::~VisibilityRaster() = default;

std::vector<std::uint8_t> VisibilityRaster::bits(std::uint32_t segment, std::uint32_t resolution,
                                                 const Checkpoint& checkpoint) const {
  CHECK_EQ(resolution % 8, 0U);
  CHECK_LE(resolution, kMaxMaskResolution);
  const SphereGrid grid(resolution);
  Painter painter(state_->scene, state_->tree, grid, segment);
  const CoverMask mask = painter.paint_all(checkpoint);
  std::vector<std::uint8_t> bits;
  bits.reserve(std::size_t{resolution} * resolution / 8);
  for (std::uint32_t r = 0; r < resolution; ++r) {
    for (std::uint32_t byte = 0; byte < resolution / 8; ++byte) {
      bits.push_back(static_cast<std::uint8_t>(~mask.row(r)[byte / 8] >> (8 * (byte % 8))));
    }
  }
  return bits;
}

}  // namespace weft::transport
