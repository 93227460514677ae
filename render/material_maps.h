#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/fabric.h"

namespace weft::render {

struct MapSettings {
  std::uint32_t width = 256;  // of the pictures that one tile is
  std::uint32_t height = 256;
  std::uint32_t samples = 16;  // eye rays of a pixel
  std::uint64_t seed = 1;
  unsigned threads = 0;  // 0: as many as the machine has
};

// One tile of cloth as renderers know surfaces: pictures [height, width], the top row first, that
// repeat endlessly. The picture's right is x, its top y; directions are in the frame of the flat
// fabric, which is the tangent space of a quad whose texture lies so. docs/formats.md derives what
// each of them is.
struct MaterialMaps {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  glm::vec2 size_mm{0, 0};
  glm::vec2 z_bounds_mm{0, 0};         // lowest and highest fibre
  std::vector<glm::vec3> base_colour;  // linear
  std::vector<glm::vec3> normal;       // unit
  std::vector<float> height_mm;        // z; z_bounds_mm.x where nothing is
  std::vector<float> roughness;        // as glTF has it: its square is the GGX width along fibres
  std::vector<glm::vec2> across;       // unit: the way of greatest roughness, across the fibres
  std::vector<float> anisotropy;       // strength, as KHR_materials_anisotropy has it
  std::vector<float> transmission;     // luminance
  std::vector<float> coverage;         // share of eye rays that meet a fibre
  glm::vec3 reflection{0, 0, 0};       // F_0: radiance of the first reflection under a white sky
  glm::vec3 sheen_colour{0, 0, 0};     // as KHR_materials_sheen has it
  float sheen_roughness = 0;
};

// Bakes them. Random numbers depend on nothing but (seed, pixel, sample): the maps are the same for
// any number of threads. Calls `progress` with the share done, from any thread but one at a time,
// and `should_stop` now and then; throws core::Error(kCancelled) when it says so. REQUIRES: a
// fabric with what was precomputed; no number of the settings but threads is 0.
[[nodiscard]] MaterialMaps bake_maps(const Fabric& fabric, const MapSettings& settings,
                                     const std::function<void(double)>& progress,
                                     const std::function<bool()>& should_stop);

}  // namespace weft::render
