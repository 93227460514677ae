#include "cli/map_set.h"

#include <cmath>
#include <functional>

#include <glm/common.hpp>

#include "core/file.h"
#include "render/png.h"

namespace weft::cli {

namespace {

constexpr double kTurn = 6.283185307179586;

// The way across the fibres in turns. It has no sign: from 135 to 315 degrees, with which nothing
// jumps near the directions of warp and weft.
double rotation_of(glm::vec2 across) {
  const double turns =
      std::atan2(static_cast<double>(across.y), static_cast<double>(across.x)) / kTurn;
  const double half = turns - kLeastRotation;
  return kLeastRotation + half - 0.5 * std::floor(2 * half);
}

using Fill = std::function<void(const render::MaterialMaps&, std::size_t, float*)>;

void grey(float value, float* rgb) { rgb[0] = rgb[1] = rgb[2] = value; }

struct KnownFile {
  std::uint32_t channels;
  std::uint32_t bits;
  Fill fill;
};

// As map_files().
const std::vector<KnownFile>& known_files() {
  static const std::vector<KnownFile> files = {
      {4, 8,
       [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         for (int c = 0; c < 3; ++c) {
           out[c] = render::srgb_encoded(std::fmin(maps.base_colour[i][c], 1.0f));
         }
         out[3] = maps.coverage[i];
       }},
      {3, 8,
       [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         for (int c = 0; c < 3; ++c) {
           out[c] = 0.5f * (maps.normal[i][c] + 1);
         }
       }},
      {3, 16,
       [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         const glm::vec2 bounds = maps.z_bounds_mm;
         grey((maps.height_mm[i] - bounds.x) / (bounds.y - bounds.x), out);
       }},
      {3, 8,
       [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         grey(maps.roughness[i], out);
       }},
      {3, 8,
       [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         out[0] = 0.5f * (maps.across[i].x + 1);
         out[1] = 0.5f * (maps.across[i].y + 1);
         out[2] = maps.anisotropy[i];
       }},
      {3, 8,
       [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         grey(maps.anisotropy[i], out);
       }},
      {3, 16,
       [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         grey(static_cast<float>((rotation_of(maps.across[i]) - kLeastRotation) / 0.5), out);
       }},
      {3, 8,
       [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         grey(maps.transmission[i], out);
       }},
      {3, 8, [](const render::MaterialMaps& maps, std::size_t i, float* out) {
         grey(maps.coverage[i], out);
       }}};
  return files;
}

nlohmann::json means_in(const render::MaterialMaps& maps) {
  const MapMeans means = means_of(maps);
  return {{"base_colour", {means.base_colour.x, means.base_colour.y, means.base_colour.z}},
          {"roughness", means.roughness},
          {"anisotropy", means.anisotropy},
          {"transmission", means.transmission},
          {"coverage", means.coverage}};
}

nlohmann::json index_of(const MapSet& set) {
  const render::MaterialMaps& maps = set.maps;
  nlohmann::json pictures = nlohmann::json::object();
  for (const MapFile& file : map_files()) {
    pictures[file.name] = {{"meaning", file.meaning},
                           {"encoding", file.is_colour ? "sRGB" : "linear"}};
  }
  return {{"fabric", set.name},
          {"reference", set.reference},
          {"content_digest", set.content_digest},
          {"size_mm", {maps.size_mm.x, maps.size_mm.y}},
          {"pixels", {maps.width, maps.height}},
          {"height_mm", {{"black", maps.z_bounds_mm.x}, {"white", maps.z_bounds_mm.y}}},
          {"reflection_f0", {maps.reflection.x, maps.reflection.y, maps.reflection.z}},
          {"mean", means_in(maps)},
          {"sheen",
           {{"colour", {maps.sheen_colour.x, maps.sheen_colour.y, maps.sheen_colour.z}},
            {"roughness", maps.sheen_roughness}}},
          {"pictures", pictures}};
}

}  // namespace

const std::vector<MapFile>& map_files() {
  static const std::vector<MapFile> files = {
      {"base_color.png", "colour under a white sky, but for the first reflection; alpha: coverage",
       true},
      {"normal.png", "mean normal of what is seen; x right, y up, z out, each from -1 to 1", false},
      {"height.png", "height, black and white as height_mm says", false},
      {"roughness.png", "square root of the GGX width along the fibres", false},
      {"anisotropy.png",
       "red, green: the way across the fibres, -1 to 1; blue: strength (KHR_materials_anisotropy)",
       false},
      {"anisotropy_strength.png", "the strength alone", false},
      {"anisotropy_rotation.png",
       "the way across the fibres, counterclockwise from the right: 135 to 315 degrees", false},
      {"transmission.png", "luminance of a white sky below the cloth, seen through its fibres",
       false},
      {"alpha.png", "share that fibres cover", false}};
  return files;
}

void write_maps(const MapSet& set, const std::filesystem::path& folder) {
  const render::MaterialMaps& maps = set.maps;
  const std::size_t pixels = std::size_t{maps.width} * maps.height;
  for (std::size_t f = 0; f < map_files().size(); ++f) {
    const KnownFile& known = known_files()[f];
    const MapFile& file = map_files()[f];
    render::MapPicture picture{maps.width, maps.height,    known.channels,
                               known.bits, file.is_colour, {}};
    picture.values.resize(pixels * known.channels);
    for (std::size_t i = 0; i < pixels; ++i) {
      known.fill(maps, i, picture.values.data() + i * known.channels);
    }
    render::write_map_png(folder / file.name, picture, maps.size_mm,
                          {{"Title", set.name + ": " + file.meaning},
                           {"Software", "weft"},
                           {"weft content", set.content_digest}});
  }
  core::write_file_atomically(folder / "maps.json", index_of(set).dump(2) + "\n");
}

MapMeans means_of(const render::MaterialMaps& maps) {
  MapMeans means;
  double weights = 0;
  double axis_x = 0;
  double axis_y = 0;
  for (std::size_t i = 0; i < maps.coverage.size(); ++i) {
    const auto weight = static_cast<double>(maps.coverage[i]);
    weights += weight;
    means.base_colour += weight * glm::dvec3(maps.base_colour[i]);
    means.roughness += weight * static_cast<double>(maps.roughness[i]);
    means.anisotropy += weight * static_cast<double>(maps.anisotropy[i]);
    means.transmission += weight * static_cast<double>(maps.transmission[i]);
    const double twice = 2 * kTurn * rotation_of(maps.across[i]);
    axis_x += weight * static_cast<double>(maps.anisotropy[i]) * std::cos(twice);
    axis_y += weight * static_cast<double>(maps.anisotropy[i]) * std::sin(twice);
  }
  means.coverage = weights / static_cast<double>(maps.coverage.size());
  const double whole = std::fmax(weights, 1e-9);
  means.base_colour = glm::min(means.base_colour / whole, glm::dvec3(1));
  means.roughness /= whole;
  means.anisotropy /= whole;
  means.transmission /= whole;
  const double mean = 0.5 * std::atan2(axis_y, axis_x);
  means.rotation = rotation_of({std::cos(mean), std::sin(mean)});
  return means;
}

}  // namespace weft::cli
