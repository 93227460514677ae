// bench_draw_pictures: draws the pictures that its standard input asks for, one JSON object a line
// (bench/picture_request.h), and answers each with one line of JSON: the mean of the cloth with its
// standard error, samples and seconds, and how far the picture is from the one it is compared with.
// Fabrics stay loaded between requests. A request that fails is answered by {"error": ...}.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <string>

#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "bench/picture_request.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "render/build_scene.h"
#include "render/compare.h"
#include "render/draw.h"
#include "render/gpu/draw_on_device.h"
#include "render/image.h"
#include "render/make_integrator.h"
#include "render/png.h"
#include "render/similarity.h"

namespace weft::bench {
namespace {

constexpr std::uint32_t kFirstSamples = 16;  // before an error is believed

struct Drawn {
  render::Drawing drawing;
  std::uint32_t samples = 0;
  double seconds = 0;
};

double relative_error(const render::Drawing& drawing) {
  const double mean = (drawing.cloth_mean.x + drawing.cloth_mean.y + drawing.cloth_mean.z) / 3;
  return mean > 0 ? glm::length(drawing.cloth_standard_error) / 3 / mean : 1e30;
}

// Adds samples to `growing` (render::GrowingDrawing or one of a device) by `add` as long as the
// request wants more.
template <class Growing, class Add>
Drawn grow(const PictureRequest& request, Growing& growing, const Add& add,
           const core::Stopwatch& watch) {
  const bool adaptive = request.target_error > 0;
  const std::uint32_t most =
      adaptive ? request.most_samples : request.scene.picture().samples_per_pixel();
  Drawn drawn;
  while (true) {
    const std::uint32_t next =
        adaptive ? std::max(growing.samples(), std::min(kFirstSamples, most)) : most;
    add(std::min(next, most - growing.samples()));
    drawn.seconds = watch.seconds();
    const bool last = growing.samples() >= most ||
                      (request.most_seconds > 0 && drawn.seconds > request.most_seconds);
    drawn.drawing = growing.drawing();
    if (last || relative_error(drawn.drawing) <= request.target_error) {
      break;
    }
  }
  drawn.samples = growing.samples();
  return drawn;
}

// The device of the last request that named one.
struct Drawer {
  core::Interrupt interrupt;
  std::string device;
  std::unique_ptr<render::gpu::DeviceRenderer> renderer;
};

// Seconds are those of all that a picture takes once the fabric is loaded.
Drawn draw(const PictureRequest& request, const render::Scene& scene, Drawer& drawer) {
  render::DrawSettings settings;
  settings.width = request.scene.picture().width();
  settings.height = request.scene.picture().height();
  settings.seed = request.scene.integration().seed();
  settings.samples_per_pixel = request.scene.picture().samples_per_pixel();
  const auto no_progress = [](double) {};
  const auto should_stop = [&] { return drawer.interrupt.requested(); };
  if (!request.device.empty()) {
    if (!drawer.renderer || drawer.device != request.device) {
      drawer.renderer.reset();
      drawer.renderer = std::make_unique<render::gpu::DeviceRenderer>(request.device);
      drawer.device = request.device;
    }
    const core::Stopwatch watch;
    render::gpu::DeviceDrawSettings on_device;
    on_device.picture = settings;
    on_device.scattering = render::scattering_of(request.scene.integration());
    on_device.nearest_samples = request.nearest_samples;
    render::gpu::DeviceDrawing growing(*drawer.renderer, scene, on_device);
    return grow(
        request, growing,
        [&](std::uint32_t count) { growing.add_samples(count, no_progress, should_stop); }, watch);
  }
  const core::Stopwatch watch;
  const auto integrator = render::make_integrator(request.scene.integration(), scene);
  render::GrowingDrawing growing(settings);
  return grow(
      request, growing,
      [&](std::uint32_t count) {
        growing.add_samples(scene.camera, *integrator, count, no_progress, should_stop);
      },
      watch);
}

nlohmann::json triple(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

// Mean over pixels and channels of the square.
double mean_square(const render::Image& image) {
  double sum = 0;
  for (const glm::vec3& pixel : image.pixels) {
    sum += glm::dot(glm::dvec3(pixel), glm::dvec3(pixel));
  }
  return sum / 3 / static_cast<double>(image.pixels.size());
}

// Pixels that no renderer may give.
std::uint64_t wrong_pixels(const render::Image& image) {
  return static_cast<std::uint64_t>(
      std::count_if(image.pixels.begin(), image.pixels.end(), [](const glm::vec3& p) {
        return !(p.x >= 0 && p.y >= 0 && p.z >= 0 && std::isfinite(p.x + p.y + p.z));
      }));
}

void compare_with(const PictureRequest& request, const render::Image& image,
                  nlohmann::json& answer) {
  const render::Image reference = render::read_exr(request.against);
  const render::Comparison comparison = render::compare(image, reference);
  answer["rmse"] = comparison.rmse_all;
  answer["reference_mean"] = triple(comparison.reference_mean);
  answer["ssim"] = render::structural_similarity(image, reference);
  if (!request.against_error.empty()) {
    answer["reference_noise"] = std::sqrt(mean_square(render::read_exr(request.against_error)));
  }
}

nlohmann::json answer_to(const std::string& line, FabricCache& fabrics, Drawer& drawer) {
  const PictureRequest request = parse_request(line);
  const auto fabric = fabrics.take(request.fabric);
  const render::Scene scene =
      render::build_scene(request.scene, [&](const std::string&) { return fabric; });
  Drawn drawn = draw(request, scene, drawer);
  const render::Drawing& drawing = drawn.drawing;
  nlohmann::json answer = {{"cloth_mean", triple(drawing.cloth_mean)},
                           {"cloth_standard_error", triple(drawing.cloth_standard_error)},
                           {"cloth_share", drawing.cloth_share},
                           {"samples", drawn.samples},
                           {"seconds", drawn.seconds},
                           {"noise", std::sqrt(mean_square(drawing.standard_error))},
                           {"wrong_pixels", wrong_pixels(drawing.image)}};
  if (!request.picture.empty()) {
    render::write_exr(request.picture, drawing.image, render::ExrPixels::kFloat);
  }
  if (!request.error_picture.empty()) {
    render::write_exr(request.error_picture, drawing.standard_error, render::ExrPixels::kFloat);
  }
  if (!request.preview.empty()) {
    render::write_png(
        request.preview, drawing.image.width, drawing.image.height,
        render::tone_mapped(drawing.image, render::automatic_exposure(drawing.image)));
  }
  if (!request.against.empty()) {
    compare_with(request, drawing.image, answer);
  }
  return answer;
}

}  // namespace
}  // namespace weft::bench

int main() {
  weft::bench::Drawer drawer;
  weft::bench::FabricCache fabrics;
  std::string line;
  while (std::getline(std::cin, line)) {
    nlohmann::json answer;
    try {
      answer = weft::bench::answer_to(line, fabrics, drawer);
    } catch (const std::exception& error) {
      answer = {{"error", error.what()}};
    }
    std::cout << answer.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
    if (drawer.interrupt.requested()) {
      return 1;
    }
  }
  return 0;
}
