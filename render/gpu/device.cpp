#include "render/gpu/device.h"

#include <algorithm>
#include <array>
#include <cstring>

#include <fmt/format.h>

#include "core/check.h"
#include "core/error.h"
#include "render/gpu/device_state.h"

namespace weft::render::gpu {

namespace {

// Waiting goes in slices; it never ends before the work does, since what the device still uses must
// not be freed. A hung device is the driver's to reset, which ends the wait with "device lost".
constexpr std::uint64_t kWaitSliceNs = 100'000'000;

bool has_extension(VkPhysicalDevice device, const char* name) {
  std::uint32_t count = 0;
  check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr),
        "listing the device's extensions");
  std::vector<VkExtensionProperties> extensions(count);
  check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()),
        "listing the device's extensions");
  return std::any_of(extensions.begin(), extensions.end(), [name](const VkExtensionProperties& e) {
    return std::strcmp(e.extensionName, name) == 0;
  });
}

// Everything before is finished and visible to everything behind.
void full_barrier(VkCommandBuffer commands, VkPipelineStageFlags before,
                  VkPipelineStageFlags behind) {
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
  vkCmdPipelineBarrier(commands, before, behind, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

constexpr VkPipelineStageFlags kWork =
    VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;

}  // namespace

void Device::State::open(const std::string& wanted) {
  const std::vector<Candidate> found = candidates(instance.handle());
  std::vector<DeviceInfo> infos;
  infos.reserve(found.size());
  for (const Candidate& candidate : found) {
    infos.push_back(candidate.info);
  }
  chosen = found[choose(infos, wanted).index];
  vkGetPhysicalDeviceMemoryProperties(chosen.device, &memory);
  unified = !options.always_stage && (chosen.info.kind == DeviceInfo::Kind::kSoftware ||
                                      chosen.info.kind == DeviceInfo::Kind::kIntegrated);
  knows_budget = has_extension(chosen.device, VK_EXT_MEMORY_BUDGET_EXTENSION_NAME);
  open_device();
  make_command_buffer();
}

void Device::State::open_device() {
  const float priority = 1;
  VkDeviceQueueCreateInfo queue_info{};
  queue_info.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
  queue_info.queueFamilyIndex = chosen.queue_family;
  queue_info.queueCount = 1;
  queue_info.pQueuePriorities = &priority;
  VkPhysicalDeviceVulkan12Features features12{};
  features12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
  features12.scalarBlockLayout = VK_TRUE;
  VkPhysicalDeviceFeatures features{};
  if (options.validation == Validation::kInKernel) {
    // With these the layer's code can report from any kind of shader.
    VkPhysicalDeviceFeatures there;
    vkGetPhysicalDeviceFeatures(chosen.device, &there);
    features.vertexPipelineStoresAndAtomics = there.vertexPipelineStoresAndAtomics;
    features.fragmentStoresAndAtomics = there.fragmentStoresAndAtomics;
  }
  const std::array<const char*, 1> extensions{VK_EXT_MEMORY_BUDGET_EXTENSION_NAME};
  VkDeviceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
  info.pNext = &features12;
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue_info;
  info.pEnabledFeatures = &features;
  info.enabledExtensionCount = knows_budget ? 1 : 0;
  info.ppEnabledExtensionNames = extensions.data();
  check(vkCreateDevice(chosen.device, &info, nullptr, &device),
        fmt::format("opening {}", chosen.info.name));
  vkGetDeviceQueue(device, chosen.queue_family, 0, &queue);
}

void Device::State::make_command_buffer() {
  const std::string doing = fmt::format("preparing {}", chosen.info.name);
  VkCommandPoolCreateInfo pool{};
  pool.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
  pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  pool.queueFamilyIndex = chosen.queue_family;
  check(vkCreateCommandPool(device, &pool, nullptr, &command_pool), doing);
  VkCommandBufferAllocateInfo buffer{};
  buffer.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
  buffer.commandPool = command_pool;
  buffer.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  buffer.commandBufferCount = 1;
  check(vkAllocateCommandBuffers(device, &buffer, &commands), doing);
  VkFenceCreateInfo signal{};
  signal.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  check(vkCreateFence(device, &signal, nullptr, &fence), doing);
}

Device::State::~State() {
  if (device == VK_NULL_HANDLE) {
    return;
  }
  CHECK_EQ(children, 0);  // buffers and kernels must not outlive their device
  staging_buffer.reset();
  vkDestroyQueryPool(device, query_pool, nullptr);
  vkDestroyDescriptorPool(device, descriptor_pool, nullptr);
  vkDestroyFence(device, fence, nullptr);
  vkDestroyCommandPool(device, command_pool, nullptr);
  vkDestroyDevice(device, nullptr);
}

void Device::State::check_alive(VkResult result, const std::string& doing) {
  lost = lost || result == VK_ERROR_DEVICE_LOST;
  check(result, fmt::format("{} on {}", doing, chosen.info.name));
}

void Device::State::submit(const std::function<void(VkCommandBuffer)>& record,
                           const std::string& doing) {
  CHECK(!lost);
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  check_alive(vkBeginCommandBuffer(commands, &begin), doing);
  full_barrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kWork);
  record(commands);
  full_barrier(commands, kWork, VK_PIPELINE_STAGE_HOST_BIT | kWork);
  check_alive(vkEndCommandBuffer(commands), doing);
  check_alive(vkResetFences(device, 1, &fence), doing);
  VkSubmitInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  info.commandBufferCount = 1;
  info.pCommandBuffers = &commands;
  check_alive(vkQueueSubmit(queue, 1, &info, fence), doing);
  VkResult result = VK_TIMEOUT;
  while (result == VK_TIMEOUT) {
    result = vkWaitForFences(device, 1, &fence, VK_TRUE, kWaitSliceNs);
  }
  check_alive(result, doing);
}

void Device::State::reserve(std::uint32_t dispatches, std::uint32_t descriptors) {
  if (dispatches <= pool_dispatches && descriptors <= pool_descriptors) {
    check_alive(vkResetDescriptorPool(device, descriptor_pool, 0), "binding buffers");
    return;
  }
  pool_dispatches = std::max(16U, std::max(pool_dispatches, 2 * dispatches));
  pool_descriptors = std::max(128U, std::max(pool_descriptors, 2 * descriptors));
  vkDestroyDescriptorPool(device, descriptor_pool, nullptr);
  descriptor_pool = VK_NULL_HANDLE;
  vkDestroyQueryPool(device, query_pool, nullptr);
  query_pool = VK_NULL_HANDLE;
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, pool_descriptors};
  VkDescriptorPoolCreateInfo sets{};
  sets.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  sets.maxSets = pool_dispatches;
  sets.poolSizeCount = 1;
  sets.pPoolSizes = &size;
  check_alive(vkCreateDescriptorPool(device, &sets, nullptr, &descriptor_pool), "binding buffers");
  VkQueryPoolCreateInfo queries{};
  queries.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
  queries.queryType = VK_QUERY_TYPE_TIMESTAMP;
  queries.queryCount = pool_dispatches + 1;
  check_alive(vkCreateQueryPool(device, &queries, nullptr, &query_pool), "preparing timestamps");
}

Device::Device(std::unique_ptr<State> state) : state_(std::move(state)) {}
Device::~Device() = default;

std::unique_ptr<Device> Device::open(const std::string& wanted, const DeviceOptions& options) {
  auto state = std::make_unique<State>(options);
  state->open(wanted);
  return std::unique_ptr<Device>(new Device(std::move(state)));
}

const DeviceInfo& Device::info() const { return state_->chosen.info; }
const std::vector<std::string>& Device::complaints() const { return state_->instance.complaints(); }
std::uint64_t Device::used_bytes() const { return state_->used_bytes; }

}  // namespace weft::render::gpu
