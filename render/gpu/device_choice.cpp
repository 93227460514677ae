#include "render/gpu/device_choice.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "core/error.h"
#include "render/gpu/instance.h"

namespace weft::render::gpu {

namespace {

DeviceInfo::Kind kind_of(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return DeviceInfo::Kind::kDiscrete;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return DeviceInfo::Kind::kVirtual;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return DeviceInfo::Kind::kIntegrated;
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
      return DeviceInfo::Kind::kSoftware;
    default:
      return DeviceInfo::Kind::kOther;
  }
}

struct ComputeQueue {
  std::uint32_t family;
  std::uint32_t timestamp_bits;
};

// A family for compute alone where there is one: it is not shared with a desktop.
std::optional<ComputeQueue> compute_queue(VkPhysicalDevice device) {
  std::uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(device, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(device, &count, families.data());
  std::optional<ComputeQueue> found;
  for (std::uint32_t i = 0; i < count; ++i) {
    const VkQueueFlags flags = families[i].queueFlags;
    const bool alone = (flags & VK_QUEUE_GRAPHICS_BIT) == 0;
    if ((flags & VK_QUEUE_COMPUTE_BIT) != 0 && (!found || alone)) {
      found = ComputeQueue{i, families[i].timestampValidBits};
      if (alone) {
        break;
      }
    }
  }
  return found;
}

std::uint64_t largest_device_heap(VkPhysicalDevice device) {
  VkPhysicalDeviceMemoryProperties memory;
  vkGetPhysicalDeviceMemoryProperties(device, &memory);
  std::uint64_t largest = 0;
  for (std::uint32_t i = 0; i < memory.memoryHeapCount; ++i) {
    if ((memory.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT) != 0) {
      largest = std::max<std::uint64_t>(largest, memory.memoryHeaps[i].size);
    }
  }
  return largest;
}

std::optional<Candidate> candidate_of(VkPhysicalDevice device) {
  VkPhysicalDeviceProperties basic;
  vkGetPhysicalDeviceProperties(device, &basic);
  const std::optional<ComputeQueue> queue = compute_queue(device);
  if (basic.apiVersion < VK_API_VERSION_1_2 || !queue) {
    return std::nullopt;
  }
  VkPhysicalDeviceVulkan12Features features12{};
  features12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
  VkPhysicalDeviceFeatures2 features{};
  features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  features.pNext = &features12;
  vkGetPhysicalDeviceFeatures2(device, &features);
  if (features12.scalarBlockLayout != VK_TRUE) {
    return std::nullopt;
  }
  VkPhysicalDeviceDriverProperties driver{};
  driver.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES;
  VkPhysicalDeviceMaintenance3Properties largest{};
  largest.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES;
  largest.pNext = &driver;
  VkPhysicalDeviceProperties2 properties{};
  properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
  properties.pNext = &largest;
  vkGetPhysicalDeviceProperties2(device, &properties);
  const VkPhysicalDeviceLimits& limits = properties.properties.limits;

  Candidate candidate;
  candidate.device = device;
  candidate.queue_family = queue->family;
  candidate.timestamp_bits = queue->timestamp_bits;
  DeviceInfo& info = candidate.info;
  info.name = basic.deviceName;
  info.driver = fmt::format("{} {}", driver.driverName, driver.driverInfo);
  info.kind = kind_of(basic.deviceType);
  info.memory_bytes = largest_device_heap(device);
  info.max_buffer_bytes =
      std::min<std::uint64_t>(limits.maxStorageBufferRange, largest.maxMemoryAllocationSize);
  info.max_groups =
      std::min(limits.maxComputeWorkGroupCount[0], limits.maxComputeWorkGroupCount[1]);
  info.timestamp_ns =
      queue->timestamp_bits == 0 ? 0.0 : static_cast<double>(limits.timestampPeriod);
  return candidate;
}

}  // namespace

std::vector<Candidate> candidates(VkInstance instance) {
  std::uint32_t count = 0;
  check(vkEnumeratePhysicalDevices(instance, &count, nullptr), "listing Vulkan's devices");
  std::vector<VkPhysicalDevice> devices(count);
  check(vkEnumeratePhysicalDevices(instance, &count, devices.data()), "listing Vulkan's devices");
  if (count == 0) {
    throw core::Error(core::Code::kFailedPrecondition,
                      fmt::format("no Vulkan driver offers a device; {}", kDriverAdvice));
  }
  std::vector<Candidate> found;
  for (VkPhysicalDevice device : devices) {
    if (std::optional<Candidate> candidate = candidate_of(device)) {
      found.push_back(*std::move(candidate));
    }
  }
  if (found.empty()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      fmt::format("none of {} Vulkan devices has version 1.2, a compute queue and "
                                  "scalar block layout; {}",
                                  count, kDriverAdvice));
  }
  // The kinds stand in the order of preference.
  std::stable_sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) {
    return a.info.kind < b.info.kind;
  });
  for (std::size_t i = 0; i < found.size(); ++i) {
    found[i].info.index = static_cast<std::uint32_t>(i);
  }
  return found;
}

std::vector<DeviceInfo> list_devices() {
  const Instance instance(Validation::kOff);
  std::vector<DeviceInfo> infos;
  for (const Candidate& candidate : candidates(instance.handle())) {
    infos.push_back(candidate.info);
  }
  return infos;
}

}  // namespace weft::render::gpu
