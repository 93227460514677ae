#include "render/scene.h"

#include <algorithm>

namespace weft::render {

SceneMeeting closest(const Scene& scene, const Ray& ray, double t_max_mm, const SceneHit* from) {
  SceneMeeting nearest;
  for (std::size_t i = 0; i < scene.cloths.size(); ++i) {
    const FibreHit* from_here = from != nullptr && from->cloth == i ? &from->fibre : nullptr;
    const Meeting meeting =
        scene.cloths[i]->closest(ray, std::min(t_max_mm, nearest.t_mm), from_here);
    if (meeting.fate != Fate::kNothing && meeting.t_mm < nearest.t_mm) {
      nearest = {meeting.fate, meeting.t_mm, {i, meeting.hit}};
    }
  }
  return nearest;
}

bool blocked_by_cloth(const Scene& scene, const Ray& ray, double t_max_mm) {
  return std::any_of(scene.cloths.begin(), scene.cloths.end(),
                     [&](const auto& cloth) { return cloth->blocks(ray, t_max_mm); });
}

}  // namespace weft::render
