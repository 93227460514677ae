#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "core/check.h"
#include "core/error.h"
#include "render/gpu/device_state.h"
#include "render/gpu/spirv.h"

namespace weft::render::gpu {

Kernel::State::~State() {
  vkDestroyPipeline(device.device, pipeline, nullptr);
  vkDestroyPipelineLayout(device.device, pipeline_layout, nullptr);
  vkDestroyDescriptorSetLayout(device.device, set_layout, nullptr);
  --device.children;
}

Kernel::Kernel() = default;
Kernel::~Kernel() = default;
Kernel::Kernel(Kernel&&) noexcept = default;
Kernel& Kernel::operator=(Kernel&&) noexcept = default;

// The layouts of its storage buffers and push constants.
void Kernel::State::make_layouts() {
  const std::string doing = fmt::format("preparing kernel {}", name);
  std::vector<VkDescriptorSetLayoutBinding> bindings(buffer_count);
  for (std::uint32_t i = 0; i < buffer_count; ++i) {
    bindings[i].binding = i;
    bindings[i].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    bindings[i].descriptorCount = 1;
    bindings[i].stageFlags = VK_SHADER_STAGE_COMPUTE_BIT;
  }
  VkDescriptorSetLayoutCreateInfo set{};
  set.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  set.bindingCount = buffer_count;
  set.pBindings = bindings.data();
  device.check_alive(vkCreateDescriptorSetLayout(device.device, &set, nullptr, &set_layout), doing);
  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, push_bytes};
  VkPipelineLayoutCreateInfo layout{};
  layout.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layout.setLayoutCount = 1;
  layout.pSetLayouts = &set_layout;
  layout.pushConstantRangeCount = push_bytes > 0 ? 1 : 0;
  layout.pPushConstantRanges = &push;
  device.check_alive(vkCreatePipelineLayout(device.device, &layout, nullptr, &pipeline_layout),
                     doing);
}

void Kernel::State::make_pipeline(const KernelCode& code,
                                  std::span<const std::uint32_t> constants) {
  const std::string doing = fmt::format("compiling kernel {}", name);
  VkShaderModuleCreateInfo words{};
  words.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  words.codeSize = code.words.size_bytes();
  words.pCode = code.words.data();
  VkShaderModule module = VK_NULL_HANDLE;
  device.check_alive(vkCreateShaderModule(device.device, &words, nullptr, &module), doing);

  std::vector<VkSpecializationMapEntry> entries;
  for (std::uint32_t i = 0; i < constants.size(); ++i) {
    entries.push_back({i, i * 4, 4});
  }
  const VkSpecializationInfo specialisation{static_cast<std::uint32_t>(entries.size()),
                                            entries.data(), constants.size_bytes(),
                                            constants.data()};
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &specialisation;
  info.layout = pipeline_layout;
  const VkResult result =
      vkCreateComputePipelines(device.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
  vkDestroyShaderModule(device.device, module, nullptr);
  device.check_alive(result, doing);
}

Kernel Device::make_kernel(const KernelCode& code, std::uint32_t buffer_count,
                           std::uint32_t push_bytes, std::span<const std::uint32_t> constants) {
  CHECK(!state_->lost);
  CHECK(push_bytes <= kPushBytesLimit && push_bytes % 4 == 0);
  CHECK_LE(spirv_buffer_count(code.words), buffer_count);
  VkPhysicalDeviceProperties properties;
  vkGetPhysicalDeviceProperties(state_->chosen.device, &properties);
  const std::uint32_t most = std::min(properties.limits.maxPerStageDescriptorStorageBuffers,
                                      properties.limits.maxDescriptorSetStorageBuffers);
  if (buffer_count > most) {
    throw core::Error(core::Code::kResourceExhausted,
                      fmt::format("kernel {} reads and writes {} buffers, and {} takes {}; use "
                                  "another device with --device",
                                  code.name, buffer_count, state_->chosen.info.name, most));
  }
  Kernel kernel;
  kernel.state_ = std::make_unique<Kernel::State>(*state_);
  kernel.state_->name = code.name;
  kernel.state_->buffer_count = buffer_count;
  kernel.state_->push_bytes = push_bytes;
  kernel.state_->make_layouts();
  kernel.state_->make_pipeline(code, constants);
  return kernel;
}

}  // namespace weft::render::gpu
