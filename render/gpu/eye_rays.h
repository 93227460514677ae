#pragma once

#include <cstdint>
#include <optional>

#include "render/camera.h"
#include "render/gpu/device_geometry.h"
#include "render/kernels/eye_ray.h"

namespace weft::render::gpu {

// What a picture's eye rays depend on.
struct EyeView {
  Camera camera;
  std::uint32_t width = 0;  // of the picture
  std::uint32_t height = 0;
  std::uint64_t seed = 1;             // DrawSettings::seed
  std::uint32_t nearest_samples = 0;  // 0: exact. Else the paper's search, with so many points in
                                      // each tetrahedron or flat piece
};

// Some samples of the pixels of a rectangle. Ray i is sample first_sample + i % sample_count of
// pixel i / sample_count, row by row.
struct EyeBatch {
  std::uint32_t left = 0;
  std::uint32_t top = 0;
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
  std::uint32_t first_sample = 0;
  std::uint32_t sample_count = 1;

  [[nodiscard]] std::uint64_t rays() const { return std::uint64_t{columns} * rows * sample_count; }
};

// What the kernel is called with for a batch.
[[nodiscard]] shading::EyeTask eye_task(const EyeView& view, const EyeBatch& batch, int cloths);

// Follows eye rays to the first fibre, on a device: the rays that draw() of render/draw.h follows,
// to the fibres that closest() of render/scene.h finds, but for rounding. Must not outlive device
// and geometry.
class EyeRays {
 public:
  // Memory for batches of at most `most_rays`. Throws core::Error(kResourceExhausted) with figures.
  // `kernel` is what make_kernel() made, for those who keep it; else it is made here. REQUIRES:
  // with nearest_samples the geometry holds the volumes (GeometrySettings).
  EyeRays(Device& device, const DeviceGeometry& geometry, const EyeView& view,
          std::uint64_t most_rays, const Kernel* kernel = nullptr);
  EyeRays(const EyeRays&) = delete;
  EyeRays& operator=(const EyeRays&) = delete;
  EyeRays(EyeRays&&) = delete;
  EyeRays& operator=(EyeRays&&) = delete;
  ~EyeRays() = default;

  [[nodiscard]] static Kernel make_kernel(Device& device);

  // Bytes that the constructor allocates.
  [[nodiscard]] static std::uint64_t size_bytes(std::uint64_t most_rays);

  // Fills hits() with a DeviceHit for each ray (render/kernels/hit.h) and returns the device's
  // nanoseconds. REQUIRES: the batch lies within the picture and most_rays.
  double follow(const EyeBatch& batch);

  [[nodiscard]] const Buffer& hits() const { return hits_; }

 private:
  Device& device_;
  const DeviceGeometry& geometry_;
  EyeView view_;
  std::uint64_t most_rays_;
  std::optional<Kernel> own_kernel_;
  const Kernel* kernel_;
  Buffer hits_;
  Buffer searches_;
  Buffer unfinished_;
};

}  // namespace weft::render::gpu
