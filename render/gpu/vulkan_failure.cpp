#include "render/gpu/vulkan_failure.h"

#include <fmt/format.h>

#include "core/error.h"
#include "render/gpu/vulkan.h"

namespace weft::render::gpu {

const char* const kDriverAdvice =
    "install the GPU's driver with its Vulkan part (NVIDIA on Debian: nvidia-vulkan-icd), or "
    "mesa-vulkan-drivers, which also has a software device";

void throw_vulkan_failure(std::int32_t result, const std::string& doing) {
  using core::Code;
  switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY:
      throw core::Error(Code::kResourceExhausted,
                        fmt::format("{}: the host is out of memory; close other programs or draw "
                                    "a smaller scene",
                                    doing));
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
      throw core::Error(Code::kResourceExhausted,
                        fmt::format("{}: the device is out of memory; close other programs that "
                                    "use it or draw a smaller scene",
                                    doing));
    case VK_ERROR_DEVICE_LOST:
      throw core::Error(Code::kUnavailable,
                        fmt::format("{}: the device was lost (its driver reset it, or it was "
                                    "removed); try again, or use another one with --device",
                                    doing));
    case VK_ERROR_INCOMPATIBLE_DRIVER:
      throw core::Error(Code::kFailedPrecondition,
                        fmt::format("there is no Vulkan driver; {}", kDriverAdvice));
    case VK_ERROR_LAYER_NOT_PRESENT:
    case VK_ERROR_EXTENSION_NOT_PRESENT:
      throw core::Error(Code::kFailedPrecondition,
                        fmt::format("{}: Vulkan's validation layer is missing; install "
                                    "vulkan-validationlayers or do not ask for validation",
                                    doing));
    default:
      throw core::Error(Code::kInternal,
                        fmt::format("{}: Vulkan failed with code {}", doing, result));
  }
}

}  // namespace weft::render::gpu
