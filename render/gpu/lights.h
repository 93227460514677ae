#pragma once

#include <vector>

#include "render/kernels/shading_records.h"
#include "render/light.h"

namespace weft::render::gpu {

// Lights as kernels read them. Light from everywhere becomes spherical Gaussians.
[[nodiscard]] std::vector<shading::DeviceLight> device_lights(const std::vector<Light>& lights);

}  // namespace weft::render::gpu
