#pragma once

#include <memory>

#include "proto/weft/v1/scene.pb.h"
#include "render/integrator.h"
#include "render/scene.h"

namespace weft::render {

// The integrator that a scene's `integration` (defaults expanded) asks for. Keeps a reference to
// `scene`, which must outlive it. With `wants_shadow` it fills EyeSample::shadow. REQUIRES: every
// fabric of `scene` has something precomputed, for INTEGRATOR_PRECOMPUTED.
[[nodiscard]] std::unique_ptr<Integrator> make_integrator(const v1::Integration& integration,
                                                          const Scene& scene,
                                                          bool wants_shadow = false);

}  // namespace weft::render
