#include "render/build_scene.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/error.h"
#include "render/flat_cloth.h"
#include "render/image.h"
#include "render/read_pattern.h"
#include "render/scene_description.h"
#include "render/shell_cloth.h"
#include "render/sphere_sampling.h"

namespace weft::render {
namespace {

constexpr double kDefaultThreads = 16;  // that a woven swatch shows each way
constexpr double kDefaultSwatchMm = 4;  // of cloth that is not woven
constexpr double kDefaultAngleDeg = 30;
constexpr double kDefaultSharpness = 50;

glm::dvec3 vector_of(const v1::Vector& v) { return {v.x(), v.y(), v.z()}; }

glm::vec3 colour_or(bool given, const v1::Colour& colour, double otherwise) {
  return given ? glm::vec3(glm::dvec3(colour.r(), colour.g(), colour.b()))
               : glm::vec3(static_cast<float>(otherwise));
}

Light area_light(const v1::AreaLight& area) {
  const glm::vec3 radiance = colour_or(area.has_radiance(), area.radiance(), 1);
  if (area.has_rectangle()) {
    const v1::Rectangle& rectangle = area.rectangle();
    return RectangleLight{vector_of(rectangle.corner()), vector_of(rectangle.edge_a()),
                          vector_of(rectangle.edge_b()), radiance};
  }
  return DiscLight{vector_of(area.disc().centre()), glm::normalize(vector_of(area.disc().normal())),
                   area.disc().radius_mm(), radiance};
}

Light light_of(const v1::Light& light, bool cut_at_horizon, const FileSource& files) {
  switch (light.kind_case()) {
    case v1::Light::kSg: {
      const v1::SgLight& sg = light.sg();
      return SgLight{glm::normalize(vector_of(sg.towards())),
                     sg.sharpness() > 0 ? sg.sharpness() : kDefaultSharpness,
                     colour_or(sg.has_irradiance(), sg.irradiance(), kPi), cut_at_horizon};
    }
    case v1::Light::kPoint:
      return PointLight{vector_of(light.point().position()),
                        colour_or(true, light.point().intensity(), 0)};
    case v1::Light::kArea:
      return area_light(light.area());
    case v1::Light::kEnvironment: {
      const v1::EnvironmentLight& environment = light.environment();
      const glm::vec3 radiance = colour_or(environment.has_radiance(), environment.radiance(), 1);
      if (environment.exr_file().empty()) {
        return UniformLight{radiance, cut_at_horizon};
      }
      return EnvironmentLight{
          std::make_shared<Environment>(
              read_exr_bytes(files(environment.exr_file()), environment.exr_file()), radiance,
              environment.turn_deg() * kPi / 180),
          cut_at_horizon};
    }
    default:  // the description was checked: a light has a kind
      return DirectionalLight{
          glm::normalize(vector_of(light.directional().towards())),
          colour_or(light.directional().has_irradiance(), light.directional().irradiance(), kPi)};
  }
}

// Whole tiles: enough for kDefaultThreads ends across, or picks along.
double default_tiles(const fabric::Tile& tile, fabric::Role role, double tile_mm) {
  const auto threads =
      std::count_if(tile.threads.begin(), tile.threads.end(),
                    [role](const fabric::Thread& thread) { return thread.role == role; });
  return threads > 0 ? std::ceil(kDefaultThreads / static_cast<double>(threads))
                     : std::ceil(kDefaultSwatchMm / tile_mm);
}

// What the files of a piece of cloth hold.
struct ClothFiles {
  std::optional<BlockPattern> pattern;
  std::optional<ObjMesh> mesh;
};

ClothFiles read_files_of(const v1::Cloth& cloth, const FileSource& files) {
  ClothFiles read;
  if (cloth.has_pattern()) {
    read.pattern = pattern_of(cloth.pattern(), files);
  }
  if (cloth.has_shell()) {
    read.mesh = read_mesh_text(files(cloth.shell().obj_file()), cloth.shell().obj_file());
  }
  return read;
}

// One fabric, or the several of a pattern.
ClothFabric fabrics_of(const v1::Cloth& cloth, const FabricSource& fabrics,
                       std::optional<BlockPattern> pattern) {
  if (!pattern) {
    return ClothFabric(fabrics(cloth.fabric()));
  }
  std::vector<std::shared_ptr<const Fabric>> several;  // shared: as FabricSource gives them
  for (const std::string& name : cloth.pattern().fabrics()) {
    several.push_back(fabrics(name));
  }
  return {std::move(several), *std::move(pattern)};
}

std::unique_ptr<Cloth> flat_cloth_of(const v1::Cloth& cloth, ClothFabric fabrics) {
  const v1::FlatSwatch& flat = cloth.flat();
  const fabric::Tile& tile = fabrics.fabrics().front()->tile();
  glm::dvec2 one_mm(tile.size_mm);
  glm::dvec2 count(default_tiles(tile, fabric::Role::kWarp, one_mm.x),
                   default_tiles(tile, fabric::Role::kWeft, one_mm.y));
  if (const BlockPattern* pattern = fabrics.pattern()) {
    one_mm = pattern->block_mm * glm::dvec2(pattern->width, pattern->height);
    count = {1, 1};
  }
  const auto size_of = [](double size_mm, double tiles, double otherwise, double tile_mm) {
    return size_mm > 0 ? size_mm : tile_mm * (tiles > 0 ? tiles : otherwise);
  };
  FlatPlacement placement;
  placement.size_mm = {size_of(flat.size_x_mm(), flat.tiles_x(), count.x, one_mm.x),
                       size_of(flat.size_y_mm(), flat.tiles_y(), count.y, one_mm.y)};
  placement.endless = flat.endless();
  placement.turn = flat.turn_deg() * kPi / 180;
  placement.centre_mm = {flat.centre_x_mm(), flat.centre_y_mm(), flat.centre_z_mm()};
  placement.black_underlay = cloth.black_underlay();
  return make_flat_cloth(std::move(fabrics), placement);
}

std::unique_ptr<Cloth> shell_cloth_of(const v1::Cloth& cloth, ClothFabric fabrics, ObjMesh mesh,
                                      std::vector<std::string>& remarks) {
  const v1::ShellMesh& shell = cloth.shell();
  const bool is_gltf = is_gltf_name(shell.obj_file());
  const double otherwise_mm = is_gltf ? 1000 : 1;
  const double scale_mm = shell.mesh_scale_mm() > 0 ? shell.mesh_scale_mm() : otherwise_mm;
  for (glm::dvec3& point : mesh.points) {
    const glm::dvec3 upright =
        shell.y_up() || is_gltf ? glm::dvec3(point.x, -point.z, point.y) : point;
    point = scale_mm * upright + vector_of(shell.move_mm());
  }
  ShellPlacement placement;
  placement.texture_mm = {shell.texture_width_mm(), shell.texture_height_mm()};
  placement.thickness_mm = shell.thickness_mm();
  placement.flip_normals = shell.flip_normals();
  placement.black_underlay = cloth.black_underlay();
  return make_shell_cloth(std::move(fabrics), mesh, placement, remarks);
}

Cloth::Bounds bounds_of(const std::vector<std::unique_ptr<Cloth>>& cloths) {
  Cloth::Bounds all = cloths.front()->bounds();
  for (const auto& cloth : cloths) {
    const Cloth::Bounds bounds = cloth->bounds();
    all.low_mm = glm::min(all.low_mm, bounds.low_mm);
    all.high_mm = glm::max(all.high_mm, bounds.high_mm);
  }
  return all;
}

// From aslant, so near that flat cloth fills the picture and a draped one just fits.
void frame(const v1::Scene& description, const Cloth::Bounds& bounds, Camera::View& view) {
  const bool all_flat = std::all_of(description.cloths().begin(), description.cloths().end(),
                                    [](const v1::Cloth& cloth) { return cloth.has_flat(); });
  const glm::dvec3 size = bounds.high_mm - bounds.low_mm;
  view.look_at_mm = 0.5 * (bounds.low_mm + bounds.high_mm);
  const double shown_mm = all_flat ? 0.7 * std::min(size.x, size.y) : 0.8 * glm::length(size);
  if (!view.perspective && !(view.height > 0)) {
    view.height = shown_mm;
  }
  const double distance_mm = view.perspective ? shown_mm / view.height : 10 * shown_mm;
  view.position_mm = view.look_at_mm + distance_mm * glm::normalize(glm::dvec3(0.2, -0.75, 1.1));
}

Camera camera_of(const v1::Scene& description, const Cloth::Bounds& bounds) {
  const v1::Camera& camera = description.camera();
  Camera::View view;
  view.perspective = !camera.has_orthographic();
  if (view.perspective) {
    const double angle_deg = camera.perspective().vertical_angle_deg() > 0
                                 ? camera.perspective().vertical_angle_deg()
                                 : kDefaultAngleDeg;
    view.height = 2 * std::tan(0.5 * angle_deg * kPi / 180);
  } else {
    view.height = camera.orthographic().height_mm();
  }
  if (camera.has_position()) {
    view.position_mm = vector_of(camera.position());
    view.look_at_mm = vector_of(camera.look_at());
    if (!view.perspective && !(view.height > 0)) {
      view.height =
          0.7 * std::min(bounds.high_mm.x - bounds.low_mm.x, bounds.high_mm.y - bounds.low_mm.y);
    }
  } else {
    frame(description, bounds, view);
  }
  if (camera.has_up()) {
    view.up = vector_of(camera.up());
  } else {
    const glm::dvec3 sight = glm::normalize(view.look_at_mm - view.position_mm);
    const bool level = std::hypot(sight.x, sight.y) > 1e-6;
    view.up = level ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
  }
  const glm::dvec3 across =
      glm::cross(glm::normalize(view.look_at_mm - view.position_mm), glm::normalize(view.up));
  if (!(glm::length(across) > 1e-6)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "camera.up lies along the line of sight; give a direction across it");
  }
  const v1::Picture& picture = description.picture();
  return {view, static_cast<double>(picture.width()) / picture.height()};
}

}  // namespace

Scene build_scene(const v1::Scene& description, const FabricSource& fabrics,
                  const FileSource& files) {
  v1::Scene whole = description;
  const v1::Scene otherwise = default_scene();
  if (whole.lights_size() == 0) {
    *whole.mutable_lights() = otherwise.lights();
  }
  if (whole.cloths_size() == 0) {
    *whole.mutable_cloths() = otherwise.cloths();
  }
  Scene scene;
  for (const v1::Light& light : whole.lights()) {
    scene.lights.push_back(light_of(light, whole.cut_lights_at_horizon(), files));
  }
  // Databases take longest to fetch and to read: what is wrong with the other files is said before.
  std::vector<ClothFiles> read;
  for (const v1::Cloth& cloth : whole.cloths()) {
    read.push_back(read_files_of(cloth, files));
  }
  for (int i = 0; i < whole.cloths_size(); ++i) {
    const v1::Cloth& cloth = whole.cloths(i);
    ClothFiles& of = read[static_cast<std::size_t>(i)];
    ClothFabric woven = fabrics_of(cloth, fabrics, std::move(of.pattern));
    scene.cloths.push_back(
        of.mesh ? shell_cloth_of(cloth, std::move(woven), *std::move(of.mesh), scene.remarks)
                : flat_cloth_of(cloth, std::move(woven)));
  }
  scene.camera = camera_of(whole, bounds_of(scene.cloths));
  scene.background = colour_or(true, whole.picture().background(), 0);
  return scene;
}

}  // namespace weft::render
