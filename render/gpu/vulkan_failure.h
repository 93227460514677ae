#pragma once

#include <cstdint>
#include <string>

namespace weft::render::gpu {

// What to install where there is no driver.
extern const char* const kDriverAdvice;

// Throws the core::Error that tells of a failed Vulkan call: kResourceExhausted when memory is
// short, kUnavailable when the device was lost, kFailedPrecondition when a driver or layer is
// missing, kInternal else. `result` is a negative VkResult, `doing` what was tried.
[[noreturn]] void throw_vulkan_failure(std::int32_t result, const std::string& doing);

}  // namespace weft::render::gpu
