#pragma once

#include <cstddef>
#include <memory>
#include <optional>

#include <glm/vec3.hpp>

#include "fabric/tile.h"
#include "transport/scene.h"
#include "transport/strand_copy.h"

namespace weft::transport {

// What Scene answers, answered by Embree's round curves: the reference that tests and benchmarks
// hold Scene against. Distances differ from Scene's by rounding, and rays that graze a fibre within
// rounding may differ. Immutable: any thread may call.
class EmbreeScene {
 public:
  // Keeps a reference to `tile`, which must outlive the scene. Throws core::Error(kInvalidArgument)
  // as Scene does, and kResourceExhausted when Embree cannot build it.
  explicit EmbreeScene(const fabric::Tile& tile);
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;
  EmbreeScene(EmbreeScene&&) = delete;
  EmbreeScene& operator=(EmbreeScene&&) = delete;

  // Memory that the scene and Embree take, as Embree's monitor and our vectors say.
  [[nodiscard]] std::size_t size_bytes() const;

  // As the functions of Scene of these names.
  [[nodiscard]] std::optional<Hit> closest(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                                           const std::optional<StrandCopy>& ignored) const;
  [[nodiscard]] bool occluded(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                              const std::optional<StrandCopy>& ignored) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace weft::transport
