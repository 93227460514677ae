#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "render/gpu/device.h"
#include "render/gpu/device_choice.h"
#include "render/gpu/instance.h"
#include "render/gpu/vulkan.h"

// What device.cpp, buffer.cpp, kernel.cpp and run.cpp share.

namespace weft::render::gpu {

// A buffer with memory of its own. `device` outlives it.
struct Allocation {
  VkDevice device = VK_NULL_HANDLE;
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  std::uint64_t capacity_bytes = 0;
  std::byte* mapped = nullptr;  // null where the host does not see the memory
  bool coherent = true;

  Allocation() = default;
  ~Allocation();
  Allocation(const Allocation&) = delete;
  Allocation& operator=(const Allocation&) = delete;
  Allocation(Allocation&&) = delete;
  Allocation& operator=(Allocation&&) = delete;

  // Before the device reads what the host wrote, and before the host reads what the device wrote.
  void flush() const;
  void invalidate() const;
};

struct Device::State {
  explicit State(const DeviceOptions& how) : instance(how.validation), options(how) {}
  ~State();
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  State(State&&) = delete;
  State& operator=(State&&) = delete;

  // Chooses and opens the device; ~State() cleans up after a failure.
  void open(const std::string& wanted);
  // Records what `record` says, with everything before it finished and visible, submits it and
  // waits for its end.
  void submit(const std::function<void(VkCommandBuffer)>& record, const std::string& doing);
  void check_alive(VkResult result, const std::string& doing);
  // Memory for a buffer; `host` asks for memory that the host sees, for staging.
  void allocate(Allocation& into, std::uint64_t size_bytes, bool host, const std::string& what);
  [[nodiscard]] std::uint64_t left_bytes(std::uint32_t heap) const;
  // The buffer through which data goes to and from memory that the host does not see.
  [[nodiscard]] Allocation& staging();

  // The steps of run(). Pools that hold as much as it needs:
  void reserve(std::uint32_t dispatches, std::uint32_t descriptors);
  void check_dispatch(const Dispatch& dispatch) const;
  [[nodiscard]] VkDescriptorSet bind(const Dispatch& dispatch);
  void record(VkCommandBuffer into, std::span<const Dispatch> dispatches,
              std::span<const VkDescriptorSet> sets) const;
  [[nodiscard]] std::vector<double> durations_ns(std::size_t count);

  Instance instance;
  DeviceOptions options;
  Candidate chosen;
  VkPhysicalDeviceMemoryProperties memory{};
  bool knows_budget = false;
  bool unified = false;  // the host sees the memory of buffers
  VkDevice device = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  VkCommandPool command_pool = VK_NULL_HANDLE;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  VkFence fence = VK_NULL_HANDLE;
  VkDescriptorPool descriptor_pool = VK_NULL_HANDLE;
  VkQueryPool query_pool = VK_NULL_HANDLE;
  std::uint32_t pool_dispatches = 0;
  std::uint32_t pool_descriptors = 0;
  std::unique_ptr<Allocation> staging_buffer;
  std::uint64_t used_bytes = 0;
  std::map<std::string, KernelTime> kernel_times;
  int children = 0;  // buffers and kernels alive
  bool lost = false;

 private:
  void open_device();
  void make_command_buffer();
};

struct Buffer::State {
  explicit State(Device::State& owner) : device(owner) { ++device.children; }
  ~State();
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  State(State&&) = delete;
  State& operator=(State&&) = delete;

  Device::State& device;
  Allocation allocation;
};

struct Kernel::State {
  explicit State(Device::State& owner) : device(owner) { ++device.children; }
  ~State();
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  State(State&&) = delete;
  State& operator=(State&&) = delete;

  void make_layouts();
  void make_pipeline(const KernelCode& code, std::span<const std::uint32_t> constants);

  Device::State& device;
  const char* name = "";
  std::uint32_t buffer_count = 0;
  std::uint32_t push_bytes = 0;
  VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
  VkPipelineLayout pipeline_layout = VK_NULL_HANDLE;
  VkPipeline pipeline = VK_NULL_HANDLE;
};

}  // namespace weft::render::gpu
