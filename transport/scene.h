#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include <glm/vec3.hpp>

#include "fabric/tile.h"

namespace weft::transport {

// Identifies a strand in endless cloth: the strand and the tile its copy belongs to, reduced by the
// strand's period, so that equal values mean the same physical fibre.
struct StrandCopy {
  std::uint32_t strand = 0;
  std::int32_t tile_x = 0;
  std::int32_t tile_y = 0;
  bool operator==(const StrandCopy&) const = default;
};

struct Hit {
  float t_mm = 0;             // distance along the (unit) direction
  std::uint32_t segment = 0;  // index in the tile
  StrandCopy copy;  // relative to the ray's own tile, the one holding its origin at (0, 0)
};

// The capsules of one tile, endlessly repeated in x and y, as an Embree scene. Rays that start
// inside a capsule do not see that capsule's exit: only entries count in closest() (transport);
// occluded() counts any overlap at the start as blocked (visibility). Immutable: any thread may
// call.
class Scene {
 public:
  // Keeps a reference to `tile`, which must outlive the scene.
  explicit Scene(const fabric::Tile& tile);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;
  Scene(Scene&&) = delete;
  Scene& operator=(Scene&&) = delete;

  [[nodiscard]] const fabric::Tile& tile() const;

  // First fibre entered by the ray from `origin_mm` (any point of endless cloth) along unit
  // `direction` before `t_max_mm`; fibres equal to `ignored` are skipped. Rays inside the slab
  // [z_min, z_max] are followed through as many tiles as it takes.
  [[nodiscard]] std::optional<Hit> closest(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                                           const std::optional<StrandCopy>& ignored) const;

  // Whether any fibre but `ignored` is met at all.
  [[nodiscard]] bool occluded(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                              const std::optional<StrandCopy>& ignored) const;

  // The copy of segment k's strand whose segment k has its midpoint in tile (0, 0), and that
  // midpoint.
  [[nodiscard]] StrandCopy own_copy(std::uint32_t segment) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace weft::transport
