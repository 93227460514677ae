#include "cli/swatch_colour.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "render/build_scene.h"
#include "render/draw.h"
#include "render/make_integrator.h"
#include "render/scene_description.h"

namespace weft::cli {

namespace {

// Eye rays of a picture, one a pixel: the mean is known to half a per cent or better.
constexpr double kPixels = 192.0 * 192.0;

void set_vector(v1::Vector& vector, double x, double y, double z) {
  vector.set_x(x);
  vector.set_y(y);
  vector.set_z(z);
}

}  // namespace

v1::Scene measuring_scene(glm::vec2 tile_size_mm, double exposure) {
  v1::Scene scene;
  scene.set_comment("45:0, annular in four directions, D65.");
  const double width = tile_size_mm.x;
  const double height = tile_size_mm.y;
  v1::Camera& camera = *scene.mutable_camera();
  set_vector(*camera.mutable_position(), 0, 0, 10 * std::max(width, height));
  set_vector(*camera.mutable_look_at(), 0, 0, 0);
  camera.mutable_orthographic()->set_height_mm(height);
  // The irradiances of four lights on the cloth add up to pi times the exposure.
  const double irradiance = exposure * std::numbers::pi / 4 * std::numbers::sqrt2;
  for (const auto& [x, y] : {std::pair{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}) {
    v1::DirectionalLight& light = *scene.add_lights()->mutable_directional();
    set_vector(*light.mutable_towards(), x, y, std::numbers::sqrt2);
    light.mutable_irradiance()->set_r(irradiance);
    light.mutable_irradiance()->set_g(irradiance);
    light.mutable_irradiance()->set_b(irradiance);
  }
  v1::Cloth& cloth = *scene.add_cloths();
  cloth.mutable_flat()->set_endless(true);
  cloth.set_black_underlay(true);
  const double side = std::sqrt(kPixels / (width * height));
  v1::Picture& picture = *scene.mutable_picture();
  picture.set_width(std::max(1U, static_cast<std::uint32_t>(std::lround(side * width))));
  picture.set_height(std::max(1U, static_cast<std::uint32_t>(std::lround(side * height))));
  picture.set_samples_per_pixel(1);
  picture.add_layers(v1::PICTURE_LAYER_SEGMENT);
  return scene;
}

SwatchPicture draw_swatch(storage::FabricDatabase database, double exposure, unsigned threads) {
  v1::Scene description = measuring_scene(database.size_mm, exposure);
  SwatchPicture picture;
  picture.fabric = render::Fabric::from_database(std::move(database),
                                                 render::Fabric::Wanted::kFibresAndTransfer);
  render::complete_scene(description, "");
  const render::Scene scene =
      render::build_scene(description, [&](const std::string&) { return picture.fabric; });
  const auto integrator = render::make_integrator(description.integration(), scene);
  render::DrawSettings settings;
  settings.width = description.picture().width();
  settings.height = description.picture().height();
  settings.samples_per_pixel = 1;
  settings.seed = description.integration().seed();
  settings.threads = threads;
  settings.layers.add(render::Layer::kSegment);
  settings.layers.add(render::Layer::kTangent);
  picture.drawing = render::draw(
      scene.camera, *integrator, settings, [](double) {}, [] { return false; });
  return picture;
}

std::size_t SwatchPicture::yarn_of(std::uint32_t segment) const {
  const fabric::Tile& tile = fabric->tile();
  return tile.threads[tile.strands[tile.segment_strand[segment]].thread].yarn;
}

std::vector<YarnColour> yarn_colours(storage::FabricDatabase database, double exposure,
                                     unsigned threads) {
  std::vector<YarnColour> colours(database.yarn_names.size());
  const SwatchPicture picture = draw_swatch(std::move(database), exposure, threads);
  const std::vector<glm::vec3>& pixels = picture.drawing.image.pixels;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::uint32_t segment = picture.drawing.layers.segment[i];
    if (segment != render::kNoSegment) {
      YarnColour& colour = colours[picture.yarn_of(segment)];
      colour.linear += glm::dvec3(pixels[i]);
      colour.share += 1;
    }
  }
  for (YarnColour& colour : colours) {
    colour.linear /= std::max(1.0, colour.share);
    colour.share /= static_cast<double>(pixels.size());
  }
  return colours;
}

}  // namespace weft::cli
