#pragma once

#include "render/gpu/device.h"

namespace weft::bench {

// What a device can do at best, measured.
struct DeviceRates {
  double copy_bytes_per_s = 0;  // read and written
  double operations_per_s = 0;  // multiplications and additions of fused ones, single precision
};

// The best of some repetitions, a second or so in all. REQUIRES: the device can tell times.
[[nodiscard]] DeviceRates measure_rates(render::gpu::Device& device);

}  // namespace weft::bench
