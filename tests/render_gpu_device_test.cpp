#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "render/gpu/device.h"
#include "render/gpu/device_renderer.h"
#include "render/gpu/kernels.h"
#include "render/gpu/spirv.h"
#include "render/gpu/vulkan_failure.h"
#include "tests/kernels/kernels.h"

namespace weft::render::gpu {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

core::Error error_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const core::Error& error) {
    return error;
  }
  ADD_FAILURE() << "nothing was thrown";
  return {core::Code::kInternal, ""};
}

// On the way of unified memory and on that of a GPU with memory of its own.
class Devices : public testing::TestWithParam<bool> {
 protected:
  void TearDown() override { EXPECT_THAT(device_->complaints(), IsEmpty()); }

  std::unique_ptr<Device> device_ =
      Device::open("", {.validation = Validation::kOn, .always_stage = GetParam()});
};

INSTANTIATE_TEST_SUITE_P(Memory, Devices, testing::Bool(),
                         [](const auto& test) { return test.param ? "Staged" : "Direct"; });

TEST_P(Devices, RunAKernelOverEveryIndex) {
  constexpr std::uint32_t kCount = 100'003;
  constexpr std::uint32_t kGroup = 64;
  std::vector<std::uint32_t> offsets(kCount);
  std::iota(offsets.begin(), offsets.end(), 7U);
  const Buffer in = device_->upload(offsets, "offsets");
  const Buffer out = device_->allocate(kCount * 4, "values");
  const std::vector<std::uint32_t> constants{kGroup, 3};
  const Kernel kernel = device_->make_kernel(test_kernels::fill_index, 2, 4, constants);
  const Dispatch dispatch{.kernel = &kernel,
                          .buffers = {&in, &out},
                          .push = push_constants(kCount),
                          .groups_x = (kCount + kGroup - 1) / kGroup};
  const std::vector<double> durations = device_->run({&dispatch, 1});
  const auto values = device_->download<std::uint32_t>(out, kCount);
  for (std::uint32_t i = 0; i < kCount; ++i) {
    ASSERT_EQ(values[i], 4 * i + 7);
  }
  ASSERT_EQ(durations.size(), 1U);
  if (device_->info().timestamp_ns > 0) {
    EXPECT_GT(durations[0], 0);
  }
}

TEST_P(Devices, ShowADispatchWhatThoseBeforeItWrote) {
  constexpr std::uint32_t kCount = 1000;
  Buffer even = device_->allocate(kCount * 4, "even");
  const Buffer odd = device_->allocate(kCount * 4, "odd");
  device_->fill_zero(even);
  const std::vector<std::uint32_t> constants{32, 1};
  const Kernel kernel = device_->make_kernel(test_kernels::fill_index, 2, 4, constants);
  // Each adds the index to what the last one left.
  std::vector<Dispatch> dispatches;
  for (int round = 0; round < 50; ++round) {
    const bool to_odd = round % 2 == 0;
    dispatches.push_back({.kernel = &kernel,
                          .buffers = {to_odd ? &even : &odd, to_odd ? &odd : &even},
                          .push = push_constants(kCount),
                          .groups_x = 32});
  }
  for (int run = 0; run < 3; ++run) {
    EXPECT_EQ(device_->run(dispatches).size(), dispatches.size());
  }
  const std::vector<KernelTime> times = device_->kernel_times();
  ASSERT_EQ(times.size(), 1U);
  EXPECT_EQ(times[0].name, "fill_index");
  EXPECT_EQ(times[0].dispatches, 150U);
  device_->forget_kernel_times();
  EXPECT_THAT(device_->kernel_times(), IsEmpty());
  const auto values = device_->download<std::uint32_t>(even, kCount);
  for (std::uint32_t i = 0; i < kCount; ++i) {
    ASSERT_EQ(values[i], 150 * i);
  }
}

TEST_P(Devices, CopyAnyPartOfABuffer) {
  // Longer than the staging buffer, and not a whole number of words.
  constexpr std::size_t kSize = (std::size_t{33} << 20) + 5;
  std::vector<std::uint8_t> bytes(kSize);
  for (std::size_t i = 0; i < kSize; ++i) {
    bytes[i] = static_cast<std::uint8_t>(i * 7 + i / 251);
  }
  Buffer buffer = device_->upload(bytes, "bytes");
  EXPECT_EQ(buffer.size_bytes(), kSize);
  EXPECT_EQ(device_->download<std::uint8_t>(buffer, kSize), bytes);

  const std::vector<std::uint8_t> part{1, 2, 3};
  device_->write(buffer, kSize - 4, std::as_bytes(std::span(part)));
  std::copy(part.begin(), part.end(), bytes.end() - 4);
  std::vector<std::uint8_t> tail(6);
  device_->read(buffer, kSize - 6, std::as_writable_bytes(std::span(tail)));
  EXPECT_TRUE(std::equal(tail.begin(), tail.end(), bytes.end() - 6));
}

TEST_P(Devices, BindAnEmptyUploadAsZeros) {
  const Buffer buffer = device_->upload(std::vector<float>{}, "nothing");
  EXPECT_EQ(buffer.size_bytes(), 16U);
  EXPECT_EQ(device_->download<std::uint32_t>(buffer, 4), (std::vector<std::uint32_t>{0, 0, 0, 0}));
}

TEST_P(Devices, CountTheBytesOfBuffersAlive) {
  EXPECT_EQ(device_->used_bytes(), 0U);
  Buffer a = device_->allocate(1000, "a");
  {
    const Buffer b = device_->allocate(2000, "b");
    EXPECT_EQ(device_->used_bytes(), 3000U);
  }
  EXPECT_EQ(device_->used_bytes(), 1000U);
  Buffer moved = std::move(a);
  EXPECT_EQ(device_->used_bytes(), 1000U);
  moved = device_->allocate(8, "c");
  EXPECT_EQ(device_->used_bytes(), 8U);
}

TEST_P(Devices, RefuseMoreMemoryThanThereIsWithNumbers) {
  const core::Error error =
      error_of([&] { (void)device_->allocate(std::uint64_t{1} << 40, "the voxels"); });
  EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
  EXPECT_THAT(error.what(), HasSubstr("1024.0 GiB for the voxels"));
  EXPECT_THAT(error.what(), HasSubstr(bytes_text(device_->info().max_buffer_bytes)));
  EXPECT_EQ(device_->used_bytes(), 0U);
}

TEST_P(Devices, RefuseWhatTheHeapHasNotLeft) {
  // Nothing touches these, so that a software device gives no memory away.
  const std::uint64_t size = device_->info().max_buffer_bytes;
  std::vector<Buffer> buffers;
  const core::Error error = error_of([&] {
    while (device_->used_bytes() <= device_->info().memory_bytes) {
      buffers.push_back(device_->allocate(size, "more"));
    }
  });
  EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
  EXPECT_THAT(error.what(), HasSubstr(" are left"));
  buffers.clear();
  EXPECT_EQ(device_->used_bytes(), 0U);
  (void)device_->upload(std::vector<float>{1, 2}, "it goes on");
}

TEST_P(Devices, RefuseMoreWorkGroupsThanTheDeviceTakes) {
  const Buffer a = device_->upload(std::vector<float>{1}, "a");
  const Buffer b = device_->upload(std::vector<float>{1}, "b");
  const std::vector<std::uint32_t> constants{1, 1};
  const Kernel kernel = device_->make_kernel(test_kernels::fill_index, 2, 4, constants);
  Dispatch dispatch{.kernel = &kernel, .buffers = {&a, &b}, .push = push_constants(1U)};
  dispatch.groups_y = device_->info().max_groups;
  if (dispatch.groups_y == UINT32_MAX) {
    GTEST_SKIP() << "this device takes any number";
  }
  ++dispatch.groups_y;
  const core::Error error = error_of([&] { (void)device_->run({&dispatch, 1}); });
  EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
  EXPECT_THAT(error.what(), HasSubstr("fill_index"));
  EXPECT_THAT(error.what(), HasSubstr(std::to_string(device_->info().max_groups)));
}

TEST(DeviceValidation, ReportsAnOverrunInsideAKernel) {
  const auto device = Device::open("", {.validation = Validation::kInKernel});
  const Buffer buffer = device->upload(std::vector<std::uint32_t>(4), "four values");
  const Kernel kernel = device->make_kernel(test_kernels::overrun, 1, 4);
  Dispatch dispatch{.kernel = &kernel, .buffers = {&buffer}, .push = push_constants(3U)};
  (void)device->run({&dispatch, 1});
  EXPECT_THAT(device->complaints(), IsEmpty());
  dispatch.push = push_constants(4U);
  (void)device->run({&dispatch, 1});
  EXPECT_THAT(device->complaints(), Contains(HasSubstr("out of bounds")));
}

TEST(DeviceValidation, SaysWhichPackageItsLayerIsIn) {
  ASSERT_EQ(setenv("VK_LAYER_PATH", "/nowhere", 1), 0);
  const core::Error error =
      error_of([] { (void)Device::open("", {.validation = Validation::kOn}); });
  ASSERT_EQ(unsetenv("VK_LAYER_PATH"), 0);
  EXPECT_EQ(error.code(), core::Code::kFailedPrecondition);
  EXPECT_THAT(error.what(), HasSubstr("install vulkan-validationlayers"));
}

TEST(Kernels, NeedNothingBeyondTheShaderCapability) {
  constexpr std::uint32_t kShader = 1;
  for (const KernelCode* code : kernels::kAll) {
    EXPECT_EQ(spirv_capabilities(code->words), std::vector<std::uint32_t>{kShader}) << code->name;
  }
  for (const KernelCode* code : test_kernels::kAll) {
    EXPECT_EQ(spirv_capabilities(code->words), std::vector<std::uint32_t>{kShader}) << code->name;
    EXPECT_GT(spirv_buffer_count(code->words), 0U) << code->name;
  }
}

// A kernel that nothing runs would be compiled and forgotten.
TEST(Kernels, AreEachRunBySomething) {
  std::string sources;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(WEFT_SOURCE_DIR "/render")) {
    if (entry.path().extension() == ".cpp") {
      sources += core::read_file(entry.path());
    }
  }
  for (const KernelCode* code : kernels::kAll) {
    EXPECT_NE(sources.find("kernels::" + std::string(code->name)), std::string::npos) << code->name;
  }
}

TEST(DeviceChoice, PutsRealGpusFirst) {
  const std::vector<DeviceInfo> devices = list_devices();
  ASSERT_FALSE(devices.empty());  // the tests need a Vulkan driver: mesa-vulkan-drivers
  for (std::size_t i = 0; i < devices.size(); ++i) {
    EXPECT_EQ(devices[i].index, i);
    EXPECT_GT(devices[i].max_buffer_bytes, 0U);
    EXPECT_FALSE(devices[i].name.empty());
    if (i > 0) {
      EXPECT_LE(devices[i - 1].kind, devices[i].kind);
    }
  }
}

TEST(DeviceChoice, TakesANumberAPartOfTheNameOrTheBest) {
  using Kind = DeviceInfo::Kind;
  std::vector<DeviceInfo> devices(3);
  devices[0] = {.index = 0, .name = "NVIDIA H100", .kind = Kind::kDiscrete};
  devices[1] = {.index = 1, .name = "Intel Arc", .kind = Kind::kIntegrated};
  devices[2] = {.index = 2, .name = "llvmpipe (LLVM 15)", .kind = Kind::kSoftware};
  EXPECT_EQ(choose(devices, "").index, 0U);
  EXPECT_EQ(choose(devices, "auto").index, 0U);
  EXPECT_EQ(choose(devices, "2").index, 2U);
  EXPECT_EQ(choose(devices, "LLVMpipe").index, 2U);
  EXPECT_EQ(choose(devices, "arc").index, 1U);
  for (const char* wrong : {"3", "-1", "radeon", "99999999999"}) {
    const core::Error error = error_of([&] { (void)choose(devices, wrong); });
    EXPECT_EQ(error.code(), core::Code::kNotFound);
    EXPECT_THAT(error.what(), HasSubstr(wrong));
    EXPECT_THAT(error.what(), HasSubstr("2: llvmpipe (LLVM 15) (software)"));
  }
}

TEST(DeviceFailures, SayWhatWasWrongAndHowToMendIt) {
  constexpr std::int32_t kOutOfDeviceMemory = -2;
  constexpr std::int32_t kDeviceLost = -4;
  constexpr std::int32_t kLayerNotPresent = -6;
  constexpr std::int32_t kIncompatibleDriver = -9;
  const auto failure = [](std::int32_t result) {
    return error_of([&] { throw_vulkan_failure(result, "drawing"); });
  };
  EXPECT_EQ(failure(kOutOfDeviceMemory).code(), core::Code::kResourceExhausted);
  EXPECT_EQ(failure(kDeviceLost).code(), core::Code::kUnavailable);
  EXPECT_THAT(failure(kDeviceLost).what(), HasSubstr("drawing: the device was lost"));
  EXPECT_THAT(failure(kLayerNotPresent).what(), HasSubstr("install vulkan-validationlayers"));
  EXPECT_THAT(failure(kIncompatibleDriver).what(), HasSubstr("mesa-vulkan-drivers"));
}

TEST(OpenRenderer, LeavesTheDrawingToTheProcessorWhereThereIsNoGpu) {
  EXPECT_EQ(open_renderer("cpu"), nullptr);
  const std::vector<DeviceInfo> devices = list_devices();
  const bool has_gpu = devices.front().kind != DeviceInfo::Kind::kSoftware;
  EXPECT_EQ(open_renderer("auto") != nullptr, has_gpu);
  const std::unique_ptr<DeviceRenderer> named = open_renderer("0");
  ASSERT_NE(named, nullptr);
  EXPECT_EQ(named->info().name, devices.front().name);
}

}  // namespace
}  // namespace weft::render::gpu
