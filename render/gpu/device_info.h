#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace weft::render::gpu {

// What a Vulkan device can do, as far as drawing cares.
struct DeviceInfo {
  enum class Kind { kDiscrete, kVirtual, kIntegrated, kOther, kSoftware };
  std::uint32_t index = 0;  // among list_devices()
  std::string name{};
  std::string driver{};  // name and version
  Kind kind = Kind::kOther;
  std::uint64_t memory_bytes = 0;      // of its largest device-local heap
  std::uint64_t max_buffer_bytes = 0;  // of one buffer, all of which a kernel may bind
  std::uint32_t max_groups = 0;        // work groups along x, and along y, of one dispatch
  double timestamp_ns = 0;             // nanoseconds of one tick; 0: it cannot tell times
};

// "discrete GPU", "software", ...
[[nodiscard]] const char* kind_name(DeviceInfo::Kind kind);

// "1.5 GiB".
[[nodiscard]] std::string bytes_text(std::uint64_t bytes);

// All Vulkan 1.2 devices with a compute queue and scalar block layout, real GPUs first. Throws
// core::Error(kFailedPrecondition) when there is none, saying what to install.
[[nodiscard]] std::vector<DeviceInfo> list_devices();

// The one of list_devices() that Device::open(wanted) takes. Throws core::Error(kNotFound) naming
// the devices there are. REQUIRES: `devices` is not empty.
[[nodiscard]] const DeviceInfo& choose(const std::vector<DeviceInfo>& devices,
                                       const std::string& wanted);

}  // namespace weft::render::gpu
