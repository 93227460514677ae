#include "render/gpu/eye_rays.h"

#include <cstddef>

#include "core/check.h"
#include "core/random.h"
#include "render/draw.h"
#include "render/gpu/kernels.h"
#include "render/kernels/eye_ray.h"

namespace weft::render::gpu {
namespace {

using shading::DeviceHit;
using shading::EyeSearch;
using shading::EyeTask;

// As the scalar block layout of the kernel has them.
static_assert(sizeof(DeviceHit) == 60 && offsetof(DeviceHit, to_eye) == 48);
static_assert(sizeof(EyeSearch) == 32 && offsetof(EyeSearch, walk) == 4);
static_assert(sizeof(EyeTask) == 104 && offsetof(EyeTask, seed) == 64 &&
              offsetof(EyeTask, nearest_samples) == 100);

constexpr std::uint32_t kBuffers = 16;    // of eye_rays.comp
constexpr std::uint32_t kGroupRays = 64;  // local_size_x of eye_rays.comp
// A ray that is not finished after so many rounds of kEyeSteps, about as many steps as the CPU
// takes, runs through cloth that has nothing in its way, or in circles through tetrahedra that are
// turned inside out; it keeps what it has met before.
constexpr int kMaxRounds = 16;

}  // namespace

EyeTask eye_task(const EyeView& view, const EyeBatch& batch, int cloths) {
  const Camera::Frame& frame = view.camera.frame();
  const std::uint64_t seed = core::derive_seed(view.seed, kPurposeOfEyeRays);
  EyeTask task{};
  task.position_mm = glm::vec3(frame.position_mm);
  task.perspective = frame.perspective ? 1 : 0;
  task.forward = glm::vec3(frame.forward);
  task.across = glm::vec3(frame.across);
  task.down = glm::vec3(frame.down);
  task.width = static_cast<int>(view.width);
  task.height = static_cast<int>(view.height);
  task.cloths = cloths;
  task.seed = {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)};
  task.left = static_cast<int>(batch.left);
  task.top = static_cast<int>(batch.top);
  task.columns = static_cast<int>(batch.columns);
  task.rows = static_cast<int>(batch.rows);
  task.first_sample = static_cast<int>(batch.first_sample);
  task.sample_count = static_cast<int>(batch.sample_count);
  task.nearest_samples = static_cast<int>(view.nearest_samples);
  return task;
}

EyeRays::EyeRays(Device& device, const DeviceGeometry& geometry, const EyeView& view,
                 std::uint64_t most_rays, const Kernel* kernel)
    : device_(device),
      geometry_(geometry),
      view_(view),
      most_rays_(most_rays),
      kernel_(kernel),
      hits_(device.allocate(most_rays * sizeof(DeviceHit), "what eye rays hit")),
      searches_(device.allocate(most_rays * sizeof(EyeSearch), "how far eye rays have come")),
      unfinished_(device.allocate(sizeof(std::uint32_t), "a count of eye rays")) {
  if (kernel_ == nullptr) {
    kernel_ = &own_kernel_.emplace(make_kernel(device));
  }
}

Kernel EyeRays::make_kernel(Device& device) {
  return device.make_kernel(kernels::eye_rays, kBuffers, sizeof(EyeTask));
}

std::uint64_t EyeRays::size_bytes(std::uint64_t most_rays) {
  return most_rays * (sizeof(DeviceHit) + sizeof(EyeSearch)) + sizeof(std::uint32_t);
}

double EyeRays::follow(const EyeBatch& batch) {
  CHECK(batch.rays() > 0 && batch.rays() <= most_rays_);
  CHECK(batch.left + batch.columns <= view_.width && batch.top + batch.rows <= view_.height);
  EyeTask task = eye_task(view_, batch, geometry_.cloths());
  Dispatch dispatch;
  dispatch.kernel = kernel_;
  dispatch.buffers = geometry_.solid_buffers();
  for (const Buffer* buffer : geometry_.grid_buffers()) {
    dispatch.buffers.push_back(buffer);
  }
  dispatch.buffers.insert(dispatch.buffers.end(), {&hits_, &searches_, &unfinished_});
  dispatch.groups_x = static_cast<std::uint32_t>((batch.rays() + kGroupRays - 1) / kGroupRays);
  double spent_ns = 0;
  for (int round = 0; round < kMaxRounds; ++round) {
    task.resumes = round > 0 ? 1 : 0;
    dispatch.push = push_constants(task);
    device_.fill_zero(unfinished_);
    spent_ns += device_.run(std::span(&dispatch, 1)).front();
    if (device_.download<std::uint32_t>(unfinished_, 1).front() == 0) {
      break;
    }
  }
  return spent_ns;
}

}  // namespace weft::render::gpu
