#pragma once

#include <cstdint>
#include <vector>

#include "render/gpu/device_info.h"
#include "render/gpu/vulkan.h"

namespace weft::render::gpu {

// A device that can draw.
struct Candidate {
  VkPhysicalDevice device = VK_NULL_HANDLE;
  std::uint32_t queue_family = 0;
  std::uint32_t timestamp_bits = 0;  // that count, of the queue's 64-bit timestamps
  DeviceInfo info;
};

// In the order of list_devices(); throws as it does.
[[nodiscard]] std::vector<Candidate> candidates(VkInstance instance);

}  // namespace weft::render::gpu
