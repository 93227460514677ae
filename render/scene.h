#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "render/camera.h"
#include "render/cloth.h"
#include "render/light.h"
#include "render/ray.h"

namespace weft::render {

// What is drawn. Immutable while it is drawn: any thread may call.
struct Scene {
  Camera camera;
  std::vector<Light> lights;
  std::vector<std::unique_ptr<Cloth>> cloths;
  glm::vec3 background{0, 0, 0};     // seen where nothing is hit; it lights nothing
  std::vector<std::string> remarks;  // what a person should know about it
};

// A hit on one of the scene's pieces of cloth.
struct SceneHit {
  std::size_t cloth = 0;
  FibreHit fibre;
};

struct SceneMeeting {
  Fate fate = Fate::kNothing;
  double t_mm = kInfinity;
  SceneHit hit;  // REQUIRES: fate == kFibre
};

// The first fibre or black sheet that a ray meets before t_max_mm; `from`, when given, is the hit
// at which it starts.
[[nodiscard]] SceneMeeting closest(const Scene& scene, const Ray& ray, double t_max_mm,
                                   const SceneHit* from);

// Whether any piece of cloth, as a solid, is in the ray's way.
[[nodiscard]] bool blocked_by_cloth(const Scene& scene, const Ray& ray, double t_max_mm);

}  // namespace weft::render
