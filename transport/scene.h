#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"
#include "transport/strand_copy.h"

namespace weft::transport {

struct Hit {
  float t_mm = 0;             // distance along the (unit) direction
  std::uint32_t segment = 0;  // index in the tile
  StrandCopy copy;  // relative to the ray's own tile, the one holding its origin at (0, 0)
};

// The capsules of one tile, endlessly repeated in x and y, in a hierarchy of their own. Rays that
// start inside a capsule do not see that capsule's exit: only entries count in closest()
// (transport); occluded() counts any overlap at the start as blocked (visibility). Immutable: any
// thread may call. Results do not depend on the caller's floating-point mode, and shifting a ray by
// whole tiles changes them only by the rounding of its origin.
class Scene {
 public:
  // Keeps a reference to `tile`, which must outlive the scene. Throws core::Error(kInvalidArgument)
  // when the tile is empty or so much smaller than its fibres that its copies fill the memory. Rays
  // are traced by the wide kernel where wide_is_available().
  explicit Scene(const fabric::Tile& tile);
  // Says which kernel: both give the same bits. REQUIRES: not wide, or a processor that has it.
  Scene(const fabric::Tile& tile, bool wide);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;
  Scene(Scene&&) = delete;
  Scene& operator=(Scene&&) = delete;

  [[nodiscard]] const fabric::Tile& tile() const;
  // Memory that the hierarchy takes, the tile not included.
  [[nodiscard]] std::size_t size_bytes() const;

  // First fibre entered by the ray from `origin_mm` (any point of endless cloth) along unit
  // `direction` before `t_max_mm`; fibres equal to `ignored` (relative to the ray's own tile) are
  // skipped. The ray is followed through as many tiles as it takes, up to EndlessTile::kMaxLegs
  // wraps: one that runs in the plane of the cloth and still meets nothing counts as escaped.
  [[nodiscard]] std::optional<Hit> closest(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                                           const std::optional<StrandCopy>& ignored) const;

  // Whether any fibre but `ignored` is met at all.
  [[nodiscard]] bool occluded(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                              const std::optional<StrandCopy>& ignored) const;

  // The copy of segment k's strand whose segment k has its midpoint in tile (0, 0); that midpoint
  // is tile().wrapped_midpoint(k).
  [[nodiscard]] StrandCopy own_copy(std::uint32_t segment) const;

  // The tile that holds a point.
  [[nodiscard]] glm::ivec2 tile_of(glm::vec3 point_mm) const;

  // A copy named relative to tile (0, 0), named relative to `tile` instead: what a path does with
  // hit.copy before it goes on from a hit point in another tile.
  [[nodiscard]] StrandCopy seen_from(const StrandCopy& copy, glm::ivec2 tile) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace weft::transport
