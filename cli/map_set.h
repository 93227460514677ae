#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/weft/v1/fabric.pb.h"
#include "render/material_maps.h"

namespace weft::cli {

// What a folder of baked maps is about.
struct MapSet {
  std::string name;            // of the fabric
  std::string reference;       // as it was asked for
  std::string content_digest;  // of the database, hexadecimal
  v1::FabricDescription description;
  const fabric::Tile* tile = nullptr;
  render::MaterialMaps maps;
};

// One picture of a set: the file, and what its values mean.
struct MapFile {
  std::string name;     // "base_color.png"
  std::string meaning;  // for people and maps.json
  bool is_colour = false;
};

// What black in anisotropy_rotation.png stands for, in turns; white is half a turn more.
inline constexpr double kLeastRotation = 0.375;

// The pictures that a set has, in the order in which they are written.
[[nodiscard]] const std::vector<MapFile>& map_files();

// Writes the pictures and maps.json, which tells their meaning and physical size, into the folder.
// Throws core::Error(kUnavailable) when a file cannot be written.
void write_maps(const MapSet& set, const std::filesystem::path& folder);

// Means over the tile, where it is covered, for who takes no pictures.
struct MapMeans {
  glm::dvec3 base_colour{0};  // linear
  double roughness = 0;
  double anisotropy = 0;
  double rotation = 0;  // turns, of the mean axis; kLeastRotation to that and a half
  double transmission = 0;
  double coverage = 0;
};
[[nodiscard]] MapMeans means_of(const render::MaterialMaps& maps);

}  // namespace weft::cli
