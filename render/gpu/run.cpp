#include <fmt/format.h>

#include "core/check.h"
#include "core/error.h"
#include "render/gpu/device_state.h"

namespace weft::render::gpu {

namespace {

constexpr std::size_t kDispatchesLimit = 4096;  // of one run

// Each dispatch sees what those before it wrote.
void dispatch_barrier(VkCommandBuffer commands) {
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT;
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                       VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 1, &barrier, 0, nullptr, 0,
                       nullptr);
}

}  // namespace

// A descriptor set with the dispatch's buffers.
VkDescriptorSet Device::State::bind(const Dispatch& dispatch) {
  const Kernel::State& kernel = *dispatch.kernel->state_;
  VkDescriptorSetAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  info.descriptorPool = descriptor_pool;
  info.descriptorSetCount = 1;
  info.pSetLayouts = &kernel.set_layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  check_alive(vkAllocateDescriptorSets(device, &info, &set), "binding buffers");
  std::vector<VkDescriptorBufferInfo> buffers;
  buffers.reserve(dispatch.buffers.size());
  for (const Buffer* buffer : dispatch.buffers) {
    buffers.push_back({buffer->state_->allocation.buffer, 0, buffer->size_bytes_});
  }
  VkWriteDescriptorSet write{};
  write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
  write.dstSet = set;
  write.descriptorCount = static_cast<std::uint32_t>(buffers.size());
  write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  write.pBufferInfo = buffers.data();
  // One write runs on over the bindings behind the first, which are all alike.
  vkUpdateDescriptorSets(device, buffers.empty() ? 0 : 1, &write, 0, nullptr);
  return set;
}

void Device::State::check_dispatch(const Dispatch& dispatch) const {
  CHECK(dispatch.kernel != nullptr && dispatch.kernel->state_ != nullptr);
  const Kernel::State& kernel = *dispatch.kernel->state_;
  CHECK(&kernel.device == this);
  CHECK_EQ(dispatch.buffers.size(), kernel.buffer_count);
  CHECK_EQ(dispatch.push.size(), kernel.push_bytes);
  for (const Buffer* buffer : dispatch.buffers) {
    CHECK(buffer != nullptr && buffer->state_ != nullptr);
    CHECK(&buffer->state_->device == this);
  }
  if (std::max(dispatch.groups_x, dispatch.groups_y) > chosen.info.max_groups) {
    throw core::Error(core::Code::kResourceExhausted,
                      fmt::format("kernel {} is to run {} x {} work groups, and {} takes {} along "
                                  "an axis; draw fewer pixels or samples at a time",
                                  kernel.name, dispatch.groups_x, dispatch.groups_y,
                                  chosen.info.name, chosen.info.max_groups));
  }
}

void Device::State::record(VkCommandBuffer into, std::span<const Dispatch> dispatches,
                           std::span<const VkDescriptorSet> sets) const {
  const bool times = chosen.timestamp_bits > 0;
  const auto count = static_cast<std::uint32_t>(dispatches.size());
  if (times) {
    vkCmdResetQueryPool(into, query_pool, 0, count + 1);
    vkCmdWriteTimestamp(into, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, query_pool, 0);
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const Dispatch& dispatch = dispatches[i];
    const Kernel::State& kernel = *dispatch.kernel->state_;
    if (i > 0) {
      dispatch_barrier(into);
    }
    vkCmdBindPipeline(into, VK_PIPELINE_BIND_POINT_COMPUTE, kernel.pipeline);
    vkCmdBindDescriptorSets(into, VK_PIPELINE_BIND_POINT_COMPUTE, kernel.pipeline_layout, 0, 1,
                            &sets[i], 0, nullptr);
    if (kernel.push_bytes > 0) {
      vkCmdPushConstants(into, kernel.pipeline_layout, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                         kernel.push_bytes, dispatch.push.data());
    }
    vkCmdDispatch(into, dispatch.groups_x, dispatch.groups_y, 1);
    if (times) {
      vkCmdWriteTimestamp(into, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, query_pool, i + 1);
    }
  }
}

std::vector<double> Device::State::durations_ns(std::size_t count) {
  std::vector<double> durations(count, 0.0);
  if (chosen.timestamp_bits == 0 || count == 0) {
    return durations;
  }
  std::vector<std::uint64_t> ticks(count + 1);
  check_alive(vkGetQueryPoolResults(device, query_pool, 0, static_cast<std::uint32_t>(count + 1),
                                    ticks.size() * sizeof(std::uint64_t), ticks.data(),
                                    sizeof(std::uint64_t),
                                    VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
              "reading timestamps");
  const std::uint64_t mask =
      chosen.timestamp_bits >= 64 ? ~0ULL : (1ULL << chosen.timestamp_bits) - 1;
  for (std::size_t i = 0; i < count; ++i) {
    // Modulo 2^bits: the counter may have wrapped round.
    durations[i] = static_cast<double>((ticks[i + 1] - ticks[i]) & mask) * chosen.info.timestamp_ns;
  }
  return durations;
}

std::vector<double> Device::run(std::span<const Dispatch> dispatches) {
  State& state = *state_;
  CHECK(!state.lost);
  CHECK_LE(dispatches.size(), kDispatchesLimit);
  if (dispatches.empty()) {
    return {};
  }
  std::uint32_t descriptors = 0;
  for (const Dispatch& dispatch : dispatches) {
    state.check_dispatch(dispatch);
    descriptors += static_cast<std::uint32_t>(dispatch.buffers.size());
  }
  state.reserve(static_cast<std::uint32_t>(dispatches.size()), descriptors);
  std::vector<VkDescriptorSet> sets;
  sets.reserve(dispatches.size());
  for (const Dispatch& dispatch : dispatches) {
    sets.push_back(state.bind(dispatch));
  }
  state.submit([&](VkCommandBuffer into) { state.record(into, dispatches, sets); },
               "running kernels");
  std::vector<double> durations = state.durations_ns(dispatches.size());
  for (std::size_t i = 0; i < dispatches.size(); ++i) {
    KernelTime& time = state.kernel_times[dispatches[i].kernel->state_->name];
    ++time.dispatches;
    time.duration_ns += durations[i];
  }
  return durations;
}

std::vector<KernelTime> Device::kernel_times() const {
  std::vector<KernelTime> times;
  for (const auto& [name, time] : state_->kernel_times) {
    times.push_back(time);
    times.back().name = name;
  }
  return times;
}

void Device::forget_kernel_times() { state_->kernel_times.clear(); }

}  // namespace weft::render::gpu
