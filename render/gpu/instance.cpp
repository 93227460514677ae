#include "render/gpu/instance.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "core/error.h"

namespace weft::render::gpu {

namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

void require_validation_layer() {
  std::uint32_t count = 0;
  check(vkEnumerateInstanceLayerProperties(&count, nullptr), "listing Vulkan's layers");
  std::vector<VkLayerProperties> layers(count);
  check(vkEnumerateInstanceLayerProperties(&count, layers.data()), "listing Vulkan's layers");
  const bool there = std::any_of(layers.begin(), layers.end(), [](const VkLayerProperties& layer) {
    return std::strcmp(layer.layerName, kValidationLayer) == 0;
  });
  if (!there) {
    throw_vulkan_failure(VK_ERROR_LAYER_NOT_PRESENT, "switching validation on");
  }
}

VKAPI_ATTR VkBool32 VKAPI_CALL take_complaint(VkDebugUtilsMessageSeverityFlagBitsEXT /*severity*/,
                                              VkDebugUtilsMessageTypeFlagsEXT /*types*/,
                                              const VkDebugUtilsMessengerCallbackDataEXT* data,
                                              void* complaints) {
  static_cast<std::vector<std::string>*>(complaints)->emplace_back(data->pMessage);
  return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT messenger_info(std::vector<std::string>& complaints) {
  VkDebugUtilsMessengerCreateInfoEXT info{};
  info.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
  info.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT |
                         VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
  info.pfnUserCallback = take_complaint;
  info.pUserData = &complaints;
  return info;
}

}  // namespace

Instance::Instance(Validation validation) {
  VkApplicationInfo application{};
  application.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
  application.pApplicationName = "weft";
  application.apiVersion = VK_API_VERSION_1_2;
  VkInstanceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
  info.pApplicationInfo = &application;

  const std::array<const char*, 1> layers{kValidationLayer};
  const std::array<const char*, 2> extensions{VK_EXT_DEBUG_UTILS_EXTENSION_NAME,
                                              VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
  // The layer does not allow both at once to be of use: its own code hides hazards.
  const VkValidationFeatureEnableEXT feature =
      validation == Validation::kInKernel
          ? VK_VALIDATION_FEATURE_ENABLE_GPU_ASSISTED_EXT
          : VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
  VkDebugUtilsMessengerCreateInfoEXT messenger = messenger_info(complaints_);
  VkValidationFeaturesEXT features{};
  features.sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT;
  features.pNext = &messenger;  // hears of mistakes in making the instance too
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = &feature;
  if (validation != Validation::kOff) {
    require_validation_layer();
    info.pNext = &features;
    info.enabledLayerCount = static_cast<std::uint32_t>(layers.size());
    info.ppEnabledLayerNames = layers.data();
    info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
  }
  check(vkCreateInstance(&info, nullptr, &instance_), "starting Vulkan");
  if (validation != Validation::kOff) {
    listen();
  }
}

void Instance::listen() {
  const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
      vkGetInstanceProcAddr(instance_, "vkCreateDebugUtilsMessengerEXT"));
  const VkDebugUtilsMessengerCreateInfoEXT info = messenger_info(complaints_);
  if (create == nullptr || create(instance_, &info, nullptr, &messenger_) != VK_SUCCESS) {
    vkDestroyInstance(instance_, nullptr);
    throw_vulkan_failure(VK_ERROR_EXTENSION_NOT_PRESENT, "listening to the validation layer");
  }
}

Instance::~Instance() {
  if (messenger_ != VK_NULL_HANDLE) {
    const auto destroy = reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(instance_, "vkDestroyDebugUtilsMessengerEXT"));
    destroy(instance_, messenger_, nullptr);
  }
  vkDestroyInstance(instance_, nullptr);
}

}  // namespace weft::render::gpu
