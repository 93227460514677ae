#include "bench/device_rates.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "bench/kernels/kernels.h"
#include "core/check.h"

namespace weft::bench {
namespace {

namespace gpu = render::gpu;

constexpr std::uint32_t kGroup = 128;  // local_size_x of both kernels
constexpr int kRepetitions = 5;

double best_seconds(gpu::Device& device, const gpu::Dispatch& dispatch) {
  double best_ns = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kRepetitions; ++i) {
    best_ns = std::min(best_ns, device.run({&dispatch, 1}).front());
  }
  return best_ns * 1e-9;
}

double copy_rate(gpu::Device& device) {
  const std::uint64_t bytes = std::min(device.info().max_buffer_bytes, std::uint64_t{256} << 20);
  gpu::Buffer from = device.allocate(bytes, "the copy's source");
  gpu::Buffer to = device.allocate(bytes, "the copy's target");
  device.fill_zero(from);
  device.fill_zero(to);
  struct {
    std::uint32_t count;
    std::uint32_t per_invocation;
  } push{static_cast<std::uint32_t>(bytes / 16), 8};
  const gpu::Kernel kernel = device.make_kernel(kernels::copy_rate, 2, sizeof(push));
  const std::uint32_t per_group = kGroup * push.per_invocation;
  const gpu::Dispatch dispatch{.kernel = &kernel,
                               .buffers = {&from, &to},
                               .push = gpu::push_constants(push),
                               .groups_x = (push.count + per_group - 1) / per_group};
  return 2 * static_cast<double>(bytes) / best_seconds(device, dispatch);
}

double operation_rate(gpu::Device& device) {
  constexpr std::uint32_t kOperationsPerRound = 8 * 4 * 2;
  struct {
    std::uint32_t rounds = 256;
    float factor = 0.999F;
    float term = 1e-3F;
  } push;
  std::uint32_t groups = 64;
  const gpu::Kernel kernel = device.make_kernel(kernels::fma_rate, 1, sizeof(push));
  // More work until it takes long enough to be told from the cost of a dispatch.
  while (true) {
    const std::uint64_t invocations = std::uint64_t{groups} * kGroup;
    const gpu::Buffer results = device.allocate(invocations * 4, "the results of arithmetic");
    const gpu::Dispatch dispatch{.kernel = &kernel,
                                 .buffers = {&results},
                                 .push = gpu::push_constants(push),
                                 .groups_x = groups};
    const double seconds = best_seconds(device, dispatch);
    if (seconds > 5e-3 || groups * 4 > device.info().max_groups) {
      return static_cast<double>(invocations) * push.rounds * kOperationsPerRound / seconds;
    }
    groups *= 4;
  }
}

}  // namespace

DeviceRates measure_rates(gpu::Device& device) {
  CHECK_GT(device.info().timestamp_ns, 0.0);
  return {copy_rate(device), operation_rate(device)};
}

}  // namespace weft::bench
