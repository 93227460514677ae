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

std::string bytes_text(std::uint64_t bytes) {
  const auto value = static_cast<double>(bytes);
  if (bytes < 1024) {
    return fmt::format("{} bytes", bytes);
  }
  if (value < 0x1p20) {
    return fmt::format("{:.1f} KiB", value / 0x1p10);
  }
  if (value < 0x1p30) {
    return fmt::format("{:.1f} MiB", value / 0x1p20);
  }
  return fmt::format("{:.1f} GiB", value / 0x1p30);
}

}  // namespace weft::render::gpu
