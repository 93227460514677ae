#pragma once

#include <filesystem>

#include "cli/map_set.h"

namespace weft::cli {

// Writes NAME.gltf and NAME.bin beside a set's pictures: an upright swatch of whole tiles, about
// kSwatchMm a side, in metres, with a material of core glTF 2.0, KHR_materials_anisotropy,
// KHR_materials_sheen and KHR_materials_specular. Where the cloth has gaps, the colour's alpha
// blends. Throws core::Error(kUnavailable) when a file cannot be written.
void write_gltf_material(const MapSet& set, const std::filesystem::path& folder);

inline constexpr double kSwatchMm = 100;

}  // namespace weft::cli
