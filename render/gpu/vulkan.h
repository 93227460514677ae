#pragma once

// The one place that includes Vulkan. Only the .cpp files of this folder include this header.
#include <string>

#include <vulkan/vulkan.h>

#include "render/gpu/vulkan_failure.h"

namespace weft::render::gpu {

// `doing` is what failed, as "making a pipeline".
inline void check(VkResult result, const std::string& doing) {
  if (result < 0) {
    throw_vulkan_failure(result, doing);
  }
}

}  // namespace weft::render::gpu
