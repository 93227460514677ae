#include "cli/gltf_material.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "core/file.h"

namespace weft::cli {

namespace {

constexpr int kFloat = 5126;
constexpr int kUnsignedShort = 5123;
constexpr int kVertices = 34962;
constexpr int kElements = 34963;
constexpr int kRepeat = 10497;
constexpr int kLinear = 9729;
constexpr int kLinearMipmaps = 9987;
constexpr float kDielectric = 0.04f;  // F_0 that KHR_materials_specular's colour multiplies
// Cloth with less cover is shown with its gaps.
constexpr double kClosed = 0.995;

template <std::size_t n>
void append(std::string& bytes, const std::array<float, n>& values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), sizeof(values));
}

// The swatch: two triangles in the plane z = 0, facing +z.
struct Swatch {
  std::array<float, 2> size_m;
  std::array<float, 2> repeats;
  std::string bytes;  // positions, normals, tangents, texture, indices
};

Swatch swatch_of(const render::MaterialMaps& maps) {
  Swatch swatch;
  for (int axis = 0; axis < 2; ++axis) {
    const auto tile_mm = static_cast<double>(maps.size_mm[axis]);
    const double repeats = std::max(1.0, std::round(kSwatchMm / tile_mm));
    swatch.repeats[static_cast<std::size_t>(axis)] = static_cast<float>(repeats);
    swatch.size_m[static_cast<std::size_t>(axis)] = static_cast<float>(repeats * tile_mm / 1000);
  }
  const float x = 0.5f * swatch.size_m[0];
  const float y = 0.5f * swatch.size_m[1];
  append(swatch.bytes, std::array<float, 12>{-x, -y, 0, x, -y, 0, x, y, 0, -x, y, 0});
  append(swatch.bytes, std::array<float, 12>{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  append(swatch.bytes, std::array<float, 16>{1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1});
  // v runs down the picture.
  const auto [u, v] = swatch.repeats;
  append(swatch.bytes, std::array<float, 8>{0, v, u, v, u, 0, 0, 0});
  const std::array<std::uint16_t, 6> indices = {0, 1, 2, 0, 2, 3};
  swatch.bytes.append(reinterpret_cast<const char*>(indices.data()), sizeof(indices));
  return swatch;
}

void put_geometry(const Swatch& swatch, const std::string& bin, nlohmann::json& gltf) {
  const float x = 0.5f * swatch.size_m[0];
  const float y = 0.5f * swatch.size_m[1];
  struct Part {
    const char* type;
    std::size_t bytes;
    int count;
    int component;
  };
  constexpr std::array<Part, 5> kParts = {{{"VEC3", 48, 4, kFloat},
                                           {"VEC3", 48, 4, kFloat},
                                           {"VEC4", 64, 4, kFloat},
                                           {"VEC2", 32, 4, kFloat},
                                           {"SCALAR", 12, 6, kUnsignedShort}}};
  std::size_t at = 0;
  for (std::size_t i = 0; i < kParts.size(); ++i) {
    gltf["bufferViews"].push_back({{"buffer", 0},
                                   {"byteOffset", at},
                                   {"byteLength", kParts[i].bytes},
                                   {"target", i + 1 == kParts.size() ? kElements : kVertices}});
    gltf["accessors"].push_back({{"bufferView", i},
                                 {"componentType", kParts[i].component},
                                 {"count", kParts[i].count},
                                 {"type", kParts[i].type}});
    at += kParts[i].bytes;
  }
  gltf["accessors"][0]["min"] = {-x, -y, 0};
  gltf["accessors"][0]["max"] = {x, y, 0};
  gltf["buffers"] =
      nlohmann::json::array({nlohmann::json{{"uri", bin}, {"byteLength", swatch.bytes.size()}}});
}

nlohmann::json material_of(const MapSet& set) {
  const render::MaterialMaps& maps = set.maps;
  const auto texture = [](int index) { return nlohmann::json{{"index", index}}; };
  const auto rgb = [](glm::vec3 c) { return nlohmann::json{c.x, c.y, c.z}; };
  nlohmann::json material = {
      {"name", set.name},
      {"doubleSided", true},
      {"alphaMode", means_of(maps).coverage < kClosed ? "BLEND" : "OPAQUE"},
      {"pbrMetallicRoughness",
       {{"baseColorTexture", texture(0)},
        {"metallicFactor", 0},
        {"roughnessFactor", 1},
        {"metallicRoughnessTexture", texture(2)}}},
      {"normalTexture", texture(1)},
      {"extensions",
       {{"KHR_materials_anisotropy",
         {{"anisotropyStrength", 1}, {"anisotropyRotation", 0}, {"anisotropyTexture", texture(3)}}},
        {"KHR_materials_sheen",
         {{"sheenColorFactor", rgb(maps.sheen_colour)},
          {"sheenRoughnessFactor", maps.sheen_roughness}}},
        {"KHR_materials_specular",
         {{"specularFactor", 1}, {"specularColorFactor", rgb(maps.reflection / kDielectric)}}}}},
      {"extras",
       {{"tile_size_mm", {maps.size_mm.x, maps.size_mm.y}},
        {"height_mm", {maps.z_bounds_mm.x, maps.z_bounds_mm.y}},
        {"height_map", "height.png"},
        {"transmission_map", "transmission.png"},
        {"content_digest", set.content_digest}}}};
  return material;
}

}  // namespace

void write_gltf_material(const MapSet& set, const std::filesystem::path& folder) {
  const Swatch swatch = swatch_of(set.maps);
  const auto list = [](const nlohmann::json& item) { return nlohmann::json::array({item}); };
  nlohmann::json attributes = {{"POSITION", 0}, {"NORMAL", 1}, {"TANGENT", 2}, {"TEXCOORD_0", 3}};
  nlohmann::json primitive = {{"attributes", attributes}, {"indices", 4}, {"material", 0}};
  nlohmann::json gltf;
  gltf["asset"] = {{"version", "2.0"}, {"generator", "weft"}};
  gltf["extensionsUsed"] = nlohmann::json::array(
      {"KHR_materials_anisotropy", "KHR_materials_sheen", "KHR_materials_specular"});
  gltf["scene"] = 0;
  gltf["scenes"] = list({{"nodes", list(0)}});
  gltf["nodes"] = list({{"mesh", 0}, {"name", set.name}});
  gltf["meshes"] = list({{"name", set.name}, {"primitives", list(primitive)}});
  gltf["materials"] = list(material_of(set));
  gltf["samplers"] = list({{"wrapS", kRepeat},
                           {"wrapT", kRepeat},
                           {"magFilter", kLinear},
                           {"minFilter", kLinearMipmaps}});
  gltf["images"] = nlohmann::json::array();
  for (const char* file : {"base_color.png", "normal.png", "roughness.png", "anisotropy.png"}) {
    gltf["textures"].push_back({{"sampler", 0}, {"source", gltf["images"].size()}});
    gltf["images"].push_back({{"uri", file}});
  }
  put_geometry(swatch, set.name + ".bin", gltf);
  core::write_file_atomically(folder / (set.name + ".bin"), swatch.bytes);
  core::write_file_atomically(folder / (set.name + ".gltf"), gltf.dump(2) + "\n");
}

}  // namespace weft::cli
