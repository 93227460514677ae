#include "render/draw_pictures.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <variant>

#include "core/clock.h"
#include "core/error.h"
#include "render/animation.h"
#include "render/environment_cache.h"
#include "render/gpu/draw_on_device.h"
#include "render/make_integrator.h"
#include "render/scene_check.h"

namespace weft::render {
namespace {

// Every frame as it will be drawn; refuses keys between which a frame cannot be.
void check_frames(const v1::Scene& scene) {
  for (const std::uint32_t number : frame_numbers(scene)) {
    const core::Mistakes mistakes = check_scene(scene_at_frame(scene, number));
    if (!mistakes.empty()) {
      throw core::Error(core::Code::kInvalidArgument,
                        (scene.has_animation() ? "frame " + std::to_string(number) + ": " : "") +
                            mistakes.front().path + ": " + mistakes.front().message);
    }
  }
}

// Samples of the next pass: as many as there are, so that each pass halves the variance.
std::uint32_t next_pass(std::uint32_t drawn, std::uint32_t wanted, bool progressive) {
  return progressive ? std::min(std::max(drawn, 1U), wanted - drawn) : wanted;
}

// A drawing that grows, by whichever means.
class Growing {
 public:
  Growing() = default;
  Growing(const Growing&) = delete;
  Growing& operator=(const Growing&) = delete;
  Growing(Growing&&) = delete;
  Growing& operator=(Growing&&) = delete;
  virtual ~Growing() = default;

  virtual void add(std::uint32_t count, const std::function<void(double)>& progress,
                   const std::function<bool()>& should_stop) = 0;
  [[nodiscard]] virtual std::uint32_t samples() const = 0;
  [[nodiscard]] virtual Drawing drawing() const = 0;
};

class GrowingOnCpu : public Growing {
 public:
  GrowingOnCpu(const v1::Integration& integration, const Scene& scene, const DrawSettings& settings)
      : scene_(scene),
        integrator_(make_integrator(integration, scene, settings.layers.has(Layer::kShadow))),
        growing_(settings) {}
  void add(std::uint32_t count, const std::function<void(double)>& progress,
           const std::function<bool()>& should_stop) override {
    growing_.add_samples(scene_.camera, *integrator_, count, progress, should_stop);
  }
  [[nodiscard]] std::uint32_t samples() const override { return growing_.samples(); }
  [[nodiscard]] Drawing drawing() const override { return growing_.drawing(); }

 private:
  const Scene& scene_;
  std::unique_ptr<Integrator> integrator_;
  GrowingDrawing growing_;
};

class GrowingOnDevice : public Growing {
 public:
  GrowingOnDevice(gpu::DeviceRenderer& device, const v1::Integration& integration,
                  const Scene& scene, const DrawSettings& settings)
      : growing_(device, scene, device_settings(integration, settings)) {}
  void add(std::uint32_t count, const std::function<void(double)>& progress,
           const std::function<bool()>& should_stop) override {
    growing_.add_samples(count, progress, should_stop);
  }
  [[nodiscard]] std::uint32_t samples() const override { return growing_.samples(); }
  [[nodiscard]] Drawing drawing() const override { return growing_.drawing(); }

 private:
  static gpu::DeviceDrawSettings device_settings(const v1::Integration& integration,
                                                 const DrawSettings& picture) {
    gpu::DeviceDrawSettings settings;
    settings.picture = picture;
    settings.scattering = scattering_of(integration);
    if (integration.paper()) {
      settings.shading = kPaperSettings;
    }
    return settings;
  }

  gpu::DeviceDrawing growing_;
};

bool has_environment(const Scene& scene) {
  return std::any_of(scene.lights.begin(), scene.lights.end(), [](const Light& light) {
    return std::holds_alternative<EnvironmentLight>(light);
  });
}

class PictureDrawer {
 public:
  PictureDrawer(const PictureSettings& settings, const FabricSource& fabrics,
                const FileSource& files, PictureSink& sink,
                const std::function<bool()>& should_stop)
      : settings_(settings),
        fabrics_(fabrics),
        files_(files),
        sink_(sink),
        should_stop_(should_stop) {}

  void draw_frame(Frame& frame) {
    const core::Stopwatch loading;
    Scene scene = build_scene(frame.scene, fabrics_, files_);
    const bool on_device =
        settings_.device != nullptr && draws_on_device(frame.scene.integration());
    if (on_device && frame.scene.integration().environment_lights() == 0 &&
        has_environment(scene)) {
      // Kernels know no other environments. The frame says so, to be drawn again.
      frame.scene.mutable_integration()->set_environment_lights(
          EnvironmentFitSettings{}.most_lights);
    }
    if (frame.scene.integration().environment_lights() > 0) {
      EnvironmentFitSettings fit;
      fit.most_lights = frame.scene.integration().environment_lights();
      fit_environments(scene, fit, settings_.environment_cache);
    }
    frame.remarks = scene.remarks;
    if (!sink_.start(frame)) {
      return;
    }
    const DrawSettings settings = draw_settings(frame.scene, settings_.threads);
    std::unique_ptr<Growing> growing;
    if (on_device) {
      growing = std::make_unique<GrowingOnDevice>(*settings_.device, frame.scene.integration(),
                                                  scene, settings);
    } else {
      growing = std::make_unique<GrowingOnCpu>(frame.scene.integration(), scene, settings);
    }
    const double load_seconds = loading.seconds();
    const core::Stopwatch drawing;
    while (growing->samples() < settings.samples_per_pixel) {
      add_pass(settings, *growing);
      const Picture picture{growing->drawing(), growing->samples(), load_seconds, drawing.seconds(),
                            on_device ? settings_.device->info().name : "cpu"};
      if (growing->samples() == settings.samples_per_pixel) {
        sink_.finish(frame, picture);
      } else {
        sink_.pass(frame, picture);
      }
    }
  }

 private:
  void add_pass(const DrawSettings& settings, Growing& growing) {
    const std::uint32_t drawn = growing.samples();
    const std::uint32_t count = next_pass(drawn, settings.samples_per_pixel, settings_.progressive);
    growing.add(
        count,
        [&](double share) { sink_.progress((drawn + share * count) / settings.samples_per_pixel); },
        should_stop_);
  }

  const PictureSettings& settings_;
  const FabricSource& fabrics_;
  const FileSource& files_;
  PictureSink& sink_;
  const std::function<bool()>& should_stop_;
};

}  // namespace

DrawSettings draw_settings(const v1::Scene& scene, unsigned threads) {
  DrawSettings settings;
  settings.width = scene.picture().width();
  settings.height = scene.picture().height();
  settings.samples_per_pixel = scene.picture().samples_per_pixel();
  settings.target_error = scene.integration().target_error();
  settings.seed = scene.integration().seed();
  settings.threads = threads;
  settings.layers = layers_of(scene.picture());
  return settings;
}

void draw_pictures(const v1::Scene& scene, const PictureSettings& settings,
                   const FabricSource& fabrics, const FileSource& files, PictureSink& sink,
                   const std::function<bool()>& should_stop) {
  check_frames(scene);
  PictureDrawer drawer(settings, fabrics, files, sink, should_stop);
  const std::vector<std::uint32_t> numbers = frame_numbers(scene);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (should_stop()) {
      throw core::Error(core::Code::kCancelled, "cancelled");
    }
    Frame frame;
    frame.number = numbers[i];
    frame.index = static_cast<std::uint32_t>(i);
    frame.count = static_cast<std::uint32_t>(numbers.size());
    frame.scene = scene_at_frame(scene, frame.number);
    drawer.draw_frame(frame);
  }
}

}  // namespace weft::render
