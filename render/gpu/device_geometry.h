#pragma once

#include <cstdint>
#include <vector>

#include "render/gpu/device.h"
#include "render/gpu/geometry.h"

namespace weft::render::gpu {

// The pieces of cloth of a scene in a device's memory. Must not outlive the device.
class DeviceGeometry {
 public:
  // Throws core::Error(kResourceExhausted) with figures, before anything is uploaded, when the
  // arrays are more than the device has room for or one of them is more than a binding may span.
  DeviceGeometry(Device& device, const GeometryArrays& arrays);

  [[nodiscard]] int cloths() const { return cloths_; }
  // For the bindings of render/kernels/solid.glsl and grid.glsl, in their order.
  [[nodiscard]] std::vector<const Buffer*> solid_buffers() const;
  [[nodiscard]] std::vector<const Buffer*> grid_buffers() const;

 private:
  int cloths_;
  std::vector<Buffer> solid_;
  std::vector<Buffer> grid_;
};

}  // namespace weft::render::gpu
