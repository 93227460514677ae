#include "render/gpu/device_sums.h"

#include <variant>

#include "render/eye_surface.h"

namespace weft::render::gpu {
namespace {

using shading::DevicePixel;

glm::dvec3 sum_of(const glm::vec3& sum, const glm::vec3& rest) {
  return glm::dvec3(sum) + glm::dvec3(rest);
}

// FibreHit::to_flat at a place of a piece of cloth.
struct RotationAt {
  int place;

  glm::mat3 operator()(const FlatForm& flat) const { return flat.to_flat; }
  glm::mat3 operator()(const ShellForm& shell) const {
    return shell.geometry->tetrahedra[static_cast<std::size_t>(place)].rotation;
  }
};

}  // namespace

std::vector<PixelSums> pixel_sums(const std::vector<DevicePixel>& pixels,
                                  const glm::vec3& background, std::uint32_t samples) {
  const glm::dvec3 behind(background);
  std::vector<PixelSums> sums;
  sums.reserve(pixels.size());
  for (const DevicePixel& pixel : pixels) {
    PixelSums of;
    of.samples = samples;
    of.cloth_radiance =
        sum_of(pixel.single, pixel.single_rest) + sum_of(pixel.multiple, pixel.multiple_rest);
    of.cloth_squared = sum_of(pixel.squared, pixel.squared_rest);
    of.on_cloth = pixel.on_cloth;
    const double on_nothing = pixel.on_nothing;
    of.radiance = of.cloth_radiance + on_nothing * behind;
    of.squared = of.cloth_squared + on_nothing * behind * behind;
    sums.push_back(of);
  }
  return sums;
}

std::vector<LayerSums> layer_sums(const std::vector<DevicePixel>& pixels, const Scene& scene,
                                  const std::vector<const Fabric*>& fabrics) {
  std::vector<LayerSums> sums;
  sums.reserve(pixels.size());
  for (const DevicePixel& pixel : pixels) {
    LayerSums of;
    of.single = sum_of(pixel.single, pixel.single_rest);
    of.multiple = sum_of(pixel.multiple, pixel.multiple_rest);
    of.shadow = static_cast<double>(pixel.shadow) + static_cast<double>(pixel.shadow_rest);
    if (pixel.segment >= 0) {
      SceneHit hit;
      hit.cloth = static_cast<std::size_t>(pixel.cloth);
      hit.fibre.segment = static_cast<std::uint32_t>(pixel.segment);
      hit.fibre.to_flat =
          std::visit(RotationAt{pixel.place}, scene.cloths[hit.cloth]->form().shape);
      hit.fibre.tangent =
          tangent_of(fabrics[static_cast<std::size_t>(pixel.fabric)]->tile(), hit.fibre.segment);
      EyeSample seen;
      describe_surface(hit, seen);
      of.segment = seen.segment;
      of.cloth = seen.cloth;
      of.tangent = seen.tangent;
      of.normal = seen.normal;
    }
    sums.push_back(of);
  }
  return sums;
}

}  // namespace weft::render::gpu
