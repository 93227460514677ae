#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "core/check.h"
#include "core/error.h"
#include "render/gpu/device_state.h"

namespace weft::render::gpu {

namespace {

constexpr std::uint64_t kStagingBytes = std::uint64_t{16} << 20;
constexpr VkMemoryPropertyFlags kHostSees = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
constexpr VkMemoryPropertyFlags kHostLikes =
    VK_MEMORY_PROPERTY_HOST_COHERENT_BIT | VK_MEMORY_PROPERTY_HOST_CACHED_BIT;

// The allowed memory type with all of `required` and most of `liked`; the first of equals, since
// drivers list the fastest first.
std::optional<std::uint32_t> memory_type(const VkPhysicalDeviceMemoryProperties& memory,
                                         std::uint32_t allowed, VkMemoryPropertyFlags required,
                                         VkMemoryPropertyFlags liked) {
  std::optional<std::uint32_t> best;
  int best_score = -1;
  for (std::uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
    const VkMemoryPropertyFlags flags = memory.memoryTypes[i].propertyFlags;
    const int score = __builtin_popcount(flags & liked);
    if ((allowed >> i & 1U) != 0 && (flags & required) == required && score > best_score) {
      best = i;
      best_score = score;
    }
  }
  return best;
}

}  // namespace

Allocation::~Allocation() {
  if (device != VK_NULL_HANDLE) {
    vkDestroyBuffer(device, buffer, nullptr);
    vkFreeMemory(device, memory, nullptr);  // unmaps too
  }
}

void Allocation::flush() const {
  if (mapped != nullptr && !coherent) {
    VkMappedMemoryRange range{};
    range.sType = VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE;
    range.memory = memory;
    range.size = VK_WHOLE_SIZE;
    check(vkFlushMappedMemoryRanges(device, 1, &range), "handing memory to the device");
  }
}

void Allocation::invalidate() const {
  if (mapped != nullptr && !coherent) {
    VkMappedMemoryRange range{};
    range.sType = VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE;
    range.memory = memory;
    range.size = VK_WHOLE_SIZE;
    check(vkInvalidateMappedMemoryRanges(device, 1, &range), "taking memory from the device");
  }
}

Buffer::State::~State() {
  device.used_bytes -= allocation.capacity_bytes;
  --device.children;
}

Buffer::Buffer() = default;
Buffer::~Buffer() = default;
Buffer::Buffer(Buffer&& other) noexcept
    : state_(std::move(other.state_)), size_bytes_(std::exchange(other.size_bytes_, 0)) {}
Buffer& Buffer::operator=(Buffer&& other) noexcept {
  state_ = std::move(other.state_);
  size_bytes_ = std::exchange(other.size_bytes_, 0);
  return *this;
}

std::uint64_t Device::State::left_bytes(std::uint32_t heap) const {
  const std::uint64_t size = memory.memoryHeaps[heap].size;
  if (!knows_budget) {
    return size - std::min(size, used_bytes);
  }
  VkPhysicalDeviceMemoryBudgetPropertiesEXT budget{};
  budget.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MEMORY_BUDGET_PROPERTIES_EXT;
  VkPhysicalDeviceMemoryProperties2 now{};
  now.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MEMORY_PROPERTIES_2;
  now.pNext = &budget;
  vkGetPhysicalDeviceMemoryProperties2(chosen.device, &now);
  // Drivers that commit memory late count it late: our own count is a bound too.
  const std::uint64_t used = std::max<std::uint64_t>(budget.heapUsage[heap], used_bytes);
  return budget.heapBudget[heap] - std::min<std::uint64_t>(budget.heapBudget[heap], used);
}

void Device::State::allocate(Allocation& into, std::uint64_t size_bytes, bool host,
                             const std::string& what) {
  CHECK(!lost);
  const std::string doing = fmt::format("allocating {} for {}", bytes_text(size_bytes), what);
  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = size_bytes;
  info.usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
               VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
  into.device = device;
  check_alive(vkCreateBuffer(device, &info, nullptr, &into.buffer), doing);
  VkMemoryRequirements needs;
  vkGetBufferMemoryRequirements(device, into.buffer, &needs);

  constexpr VkMemoryPropertyFlags kOwn = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
  std::optional<std::uint32_t> type;
  if (host) {
    type = memory_type(memory, needs.memoryTypeBits, kHostSees, kHostLikes);
  } else if (unified) {
    type = memory_type(memory, needs.memoryTypeBits, kOwn | kHostSees, kHostLikes);
  }
  if (!type) {
    // Every device has such a type for buffers, says the specification.
    type = memory_type(memory, needs.memoryTypeBits, host ? kHostSees : kOwn, 0);
  }
  CHECK(type.has_value());
  const VkMemoryType& chosen_type = memory.memoryTypes[*type];
  const std::uint64_t left = left_bytes(chosen_type.heapIndex);
  if (needs.size > left) {
    throw core::Error(core::Code::kResourceExhausted,
                      fmt::format("{} for {} do not fit on {}: {} of its {} are left; draw a "
                                  "smaller scene, or use another device with --device",
                                  bytes_text(needs.size), what, chosen.info.name, bytes_text(left),
                                  bytes_text(memory.memoryHeaps[chosen_type.heapIndex].size)));
  }
  VkMemoryAllocateInfo allocation{};
  allocation.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  allocation.allocationSize = needs.size;
  allocation.memoryTypeIndex = *type;
  check_alive(vkAllocateMemory(device, &allocation, nullptr, &into.memory), doing);
  check_alive(vkBindBufferMemory(device, into.buffer, into.memory, 0), doing);
  if (host || (unified && (chosen_type.propertyFlags & kHostSees) != 0)) {
    void* mapped = nullptr;
    check_alive(vkMapMemory(device, into.memory, 0, VK_WHOLE_SIZE, 0, &mapped), doing);
    into.mapped = static_cast<std::byte*>(mapped);
  }
  into.coherent = (chosen_type.propertyFlags & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT) != 0;
  into.capacity_bytes = size_bytes;
}

Allocation& Device::State::staging() {
  if (staging_buffer == nullptr) {
    auto made = std::make_unique<Allocation>();
    allocate(*made, kStagingBytes, true, "staging");
    staging_buffer = std::move(made);
  }
  return *staging_buffer;
}

Buffer Device::allocate(std::uint64_t size_bytes, const std::string& what) {
  CHECK_GT(size_bytes, 0U);
  State& state = *state_;
  const DeviceInfo& info = state.chosen.info;
  if (size_bytes > info.max_buffer_bytes) {
    throw core::Error(
        core::Code::kResourceExhausted,
        fmt::format(
            "{} for {} do not fit on {}: one buffer may have {} there, of {} in all; draw a "
            "smaller scene, or use another device with --device",
            bytes_text(size_bytes), what, info.name, bytes_text(info.max_buffer_bytes),
            bytes_text(info.memory_bytes)));
  }
  Buffer buffer;
  buffer.state_ = std::make_unique<Buffer::State>(state);
  // Whole words, so that it can be filled.
  state.allocate(buffer.state_->allocation, (size_bytes + 3) / 4 * 4, false, what);
  state.used_bytes += buffer.state_->allocation.capacity_bytes;
  buffer.size_bytes_ = size_bytes;
  return buffer;
}

Buffer Device::upload(std::span<const std::byte> bytes, const std::string& what) {
  constexpr std::uint64_t kEmptyBytes = 16;
  Buffer buffer = allocate(bytes.empty() ? kEmptyBytes : bytes.size(), what);
  if (bytes.empty()) {
    fill_zero(buffer);
  } else {
    write(buffer, 0, bytes);
  }
  return buffer;
}

void Device::write(Buffer& to, std::uint64_t offset_bytes, std::span<const std::byte> bytes) {
  CHECK(!state_->lost);
  CHECK_LE(offset_bytes, to.size_bytes_);
  CHECK_LE(bytes.size(), to.size_bytes_ - offset_bytes);
  const Allocation& target = to.state_->allocation;
  if (target.mapped != nullptr) {
    std::copy(bytes.begin(), bytes.end(), target.mapped + offset_bytes);
    target.flush();
    return;
  }
  for (std::uint64_t done = 0; done < bytes.size(); done += kStagingBytes) {
    const std::uint64_t size = std::min<std::uint64_t>(kStagingBytes, bytes.size() - done);
    const Allocation& staging = state_->staging();
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(done), size, staging.mapped);
    staging.flush();
    const VkBufferCopy region{0, offset_bytes + done, size};
    state_->submit(
        [&](VkCommandBuffer into) {
          vkCmdCopyBuffer(into, staging.buffer, target.buffer, 1, &region);
        },
        "uploading");
  }
}

void Device::read(const Buffer& from, std::uint64_t offset_bytes, std::span<std::byte> bytes) {
  CHECK(!state_->lost);
  CHECK_LE(offset_bytes, from.size_bytes_);
  CHECK_LE(bytes.size(), from.size_bytes_ - offset_bytes);
  const Allocation& source = from.state_->allocation;
  if (source.mapped != nullptr) {
    source.invalidate();
    std::copy_n(source.mapped + offset_bytes, bytes.size(), bytes.begin());
    return;
  }
  for (std::uint64_t done = 0; done < bytes.size(); done += kStagingBytes) {
    const std::uint64_t size = std::min<std::uint64_t>(kStagingBytes, bytes.size() - done);
    const Allocation& staging = state_->staging();
    const VkBufferCopy region{offset_bytes + done, 0, size};
    state_->submit(
        [&](VkCommandBuffer into) {
          vkCmdCopyBuffer(into, source.buffer, staging.buffer, 1, &region);
        },
        "downloading");
    staging.invalidate();
    std::copy_n(staging.mapped, size, bytes.begin() + static_cast<std::ptrdiff_t>(done));
  }
}

void Device::fill_zero(Buffer& buffer) {
  CHECK(buffer.state_ != nullptr);
  state_->submit(
      [&](VkCommandBuffer into) {
        vkCmdFillBuffer(into, buffer.state_->allocation.buffer, 0, VK_WHOLE_SIZE, 0);
      },
      "clearing a buffer");
}

}  // namespace weft::render::gpu
