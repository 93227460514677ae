#pragma once

#include <string>
#include <vector>

#include "render/gpu/device.h"
#include "render/gpu/vulkan.h"

namespace weft::render::gpu {

// A Vulkan instance, with the validation layer where it is wanted. Throws as Device::open() does.
class Instance {
 public:
  explicit Instance(Validation validation);
  ~Instance();
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;
  Instance(Instance&&) = delete;
  Instance& operator=(Instance&&) = delete;

  [[nodiscard]] VkInstance handle() const { return instance_; }
  [[nodiscard]] const std::vector<std::string>& complaints() const { return complaints_; }

 private:
  void listen();

  VkInstance instance_ = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  std::vector<std::string> complaints_;
};

}  // namespace weft::render::gpu
