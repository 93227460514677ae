#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "render/draw.h"
#include "render/gpu/device_renderer.h"
#include "render/integrator.h"
#include "render/kernels/shading_records.h"
#include "render/scene.h"

namespace weft::render::gpu {

struct DeviceDrawSettings {
  DrawSettings picture;  // threads are of no meaning here
  Scattering scattering = Scattering::kAll;
  std::optional<PrecomputedSettings> shading;  // in place of the fabrics' own
  std::uint32_t nearest_samples = 0;           // EyeView::nearest_samples
  // Most eye rays of one submission, and most pixels whose sums the device holds at once; 0: as
  // many as suit it. The picture does not depend on them.
  std::uint32_t most_rays = 0;
  std::uint32_t most_pixels = 0;
};

// A drawing by a device that grows, as GrowingDrawing does: the picture that PrecomputedIntegrator
// draws, with other random numbers behind the eye rays, hence equal up to noise. It depends on the
// seed and on nothing else: not on how its samples are spread over passes, bands and submissions.
// Work goes in submissions of some milliseconds. A device that is lost is opened anew once, and the
// band that was being drawn is drawn again.
class DeviceDrawing {
 public:
  // Uploads the scene. Throws core::Error: kResourceExhausted with figures when it does not fit.
  // Keeps references to `renderer` and `scene`. REQUIRES: as draw(); every fabric of the scene has
  // something precomputed.
  DeviceDrawing(DeviceRenderer& renderer, const Scene& scene, const DeviceDrawSettings& settings);
  ~DeviceDrawing();
  DeviceDrawing(const DeviceDrawing&) = delete;
  DeviceDrawing& operator=(const DeviceDrawing&) = delete;
  DeviceDrawing(DeviceDrawing&&) = delete;
  DeviceDrawing& operator=(DeviceDrawing&&) = delete;

  // Adds `count` samples to every pixel; `progress` and `should_stop` as for draw(). After an
  // exception the sums are of no use: take drawing() before.
  void add_samples(std::uint32_t count, const std::function<void(double)>& progress,
                   const std::function<bool()>& should_stop);

  [[nodiscard]] std::uint32_t samples() const { return samples_; }
  // REQUIRES: samples() > 0.
  [[nodiscard]] Drawing drawing() const;

 private:
  struct OnDevice;
  struct Band;
  void put_on_device();
  void draw_band(const Band& band, const std::function<void(double)>& progress,
                 const std::function<bool()>& should_stop);
  void draw_batch(const shading::Batch& batch);

  DeviceRenderer& renderer_;
  const Scene& scene_;
  DeviceDrawSettings settings_;
  std::vector<const Fabric*> fabrics_;  // by DeviceHit::fabric
  std::vector<shading::DevicePixel> pixels_;
  std::uint32_t samples_ = 0;
  std::uint64_t rays_at_once_ = 0;
  bool was_lost_ = false;
  std::unique_ptr<OnDevice> on_device_;
};

// All samples in one pass.
[[nodiscard]] Drawing draw_on_device(DeviceRenderer& renderer, const Scene& scene,
                                     const DeviceDrawSettings& settings,
                                     const std::function<void(double)>& progress,
                                     const std::function<bool()>& should_stop);

}  // namespace weft::render::gpu
