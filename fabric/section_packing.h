#pragma once

#include <vector>

#include <glm/vec2.hpp>

namespace weft::fabric {

// Moves points in an ellipse with half axes `half_mm` apart until they lie `apart_mm` from each
// other as far as there is room for so many; none leaves the ellipse. All points move at once, so
// that no order is preferred.
void spread_in_ellipse(std::vector<glm::dvec2>& points_mm, glm::dvec2 half_mm, double apart_mm);

}  // namespace weft::fabric
