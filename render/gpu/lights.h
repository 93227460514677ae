#pragma once

#include <vector>

#include "render/kernels/shading_records.h"
#include "render/light.h"

namespace weft::render::gpu {

// Lights as kernels read them. What is an environment still becomes spherical Gaussians, by a fit
// of some seconds: callers that draw often fit before (environment_cache.h).
[[nodiscard]] std::vector<shading::DeviceLight> device_lights(const std::vector<Light>& lights);

}  // namespace weft::render::gpu
