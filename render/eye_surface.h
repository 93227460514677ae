#pragma once

#include "core/random.h"
#include "render/integrator.h"
#include "render/scene.h"

namespace weft::render {

// Fills what `seen` says of the surface at `hit`: on_cloth, segment, cloth, tangent and normal.
void describe_surface(const SceneHit& hit, EyeSample& seen);

// An estimate of the share of all light from above the horizon of the flat fabric that cloth as a
// whole lets through to the upper surface above `hit`: one shadow ray for each light, weighed by
// the irradiance that it brings (Khungurn et al. 2017, figure 5). 0 where no light comes from
// above.
[[nodiscard]] float share_let_through(const Scene& scene, const SceneHit& hit,
                                      core::Random& random);

}  // namespace weft::render
