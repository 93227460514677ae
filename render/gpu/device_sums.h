#pragma once

#include <cstdint>
#include <vector>

#include "render/kernels/shading_records.h"
#include "render/pixel_sums.h"
#include "render/scene.h"

namespace weft::render::gpu {

// The sums over the `samples` samples of each of a picture's pixels as the device made them.
// `fabrics`: by DeviceHit::fabric. References must outlive the call.
[[nodiscard]] std::vector<PixelSums> pixel_sums(const std::vector<shading::DevicePixel>& pixels,
                                                const glm::vec3& background, std::uint32_t samples);
[[nodiscard]] std::vector<LayerSums> layer_sums(const std::vector<shading::DevicePixel>& pixels,
                                                const Scene& scene,
                                                const std::vector<const Fabric*>& fabrics);

}  // namespace weft::render::gpu
