#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/fabric.h"
#include "transport/scene.h"

namespace weft::render {

// Which fabric each block of patterned cloth shows (Khungurn et al. 2017, section 6.4): a matrix of
// indices, repeated endlessly over the flat fabric. Block (i, j) spans [i, i + 1) block_mm.x across
// and [j, j + 1) block_mm.y along; row 0 is j = 0.
struct BlockPattern {
  glm::dvec2 block_mm{1, 1};
  std::uint32_t width = 1;
  std::uint32_t height = 1;
  std::vector<std::uint32_t> fabric{0};  // [height, width]

  [[nodiscard]] std::uint32_t at(std::int64_t i, std::int64_t j) const;
};

// The first fibre that a piece of a straight line in the flat, endless cloth enters.
struct FlatHit {
  double share = 0;  // of the way
  std::uint32_t segment = 0;
  transport::StrandCopy copy;  // relative to tile (0, 0)
  std::uint32_t fabric = 0;    // of the cloth's
};

// A fibre that a line starts on.
struct FlatStart {
  transport::StrandCopy copy;  // relative to tile (0, 0)
  std::uint32_t fabric = 0;
};

// What a piece of cloth is of: one fabric, or several in a pattern. In every block the cloth is the
// endless fabric of that block, cut at the block's border: fabrics with ends and picks at the same
// places go on across it. The fabrics are shared by the pieces of one scene. Immutable: any thread
// may call.
class ClothFabric {
 public:
  explicit ClothFabric(std::shared_ptr<const Fabric> fabric);
  // Takes the pattern's block_mm from the fabrics. Throws core::Error(kInvalidArgument) when their
  // blocks differ in size by more than 1e-5 of it. REQUIRES: a fabric, and a pattern of at least
  // one block that names none but these.
  ClothFabric(std::vector<std::shared_ptr<const Fabric>> fabrics, BlockPattern pattern);

  [[nodiscard]] const std::vector<std::shared_ptr<const Fabric>>& fabrics() const {
    return fabrics_;
  }
  // Nothing when all is of one fabric.
  [[nodiscard]] const BlockPattern* pattern() const { return pattern_ ? &*pattern_ : nullptr; }
  // Bounds of the fibres of all fabrics.
  [[nodiscard]] double low_mm() const { return low_mm_; }
  [[nodiscard]] double high_mm() const { return high_mm_; }

  // From `start_mm` along `way_mm` (not unit: its length is the piece's); the fibre `from` is not
  // met.
  [[nodiscard]] std::optional<FlatHit> closest(const glm::dvec3& start_mm, const glm::dvec3& way_mm,
                                               const std::optional<FlatStart>& from) const;

 private:
  [[nodiscard]] std::optional<FlatHit> closest_of(std::uint32_t fabric, const glm::dvec3& start_mm,
                                                  const glm::dvec3& way_mm,
                                                  const std::optional<FlatStart>& from) const;

  std::vector<std::shared_ptr<const Fabric>> fabrics_;
  std::optional<BlockPattern> pattern_;
  double low_mm_ = 0;
  double high_mm_ = 0;
};

}  // namespace weft::render
