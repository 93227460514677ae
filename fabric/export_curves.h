#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"

namespace weft::fabric {

enum class CurveFormat { kPbrt, kBcc, kObj, kUsda };

// What is written beside the tile.
struct ExportOptions {
  CurveFormat format = CurveFormat::kObj;
  glm::uvec2 tiles{1, 1};          // copies of the tile across and along
  std::vector<glm::vec3> albedos;  // linear RGB of each of the tile's materials (pbrt, USDA)
};

// More control points than this are not written.
inline constexpr std::uint64_t kExportPointLimit = std::uint64_t{1} << 27;

// The tile's fibres, copied over the tiles, as a file for other programs; lengths in millimetres.
// Every copy of a strand is one curve; where it goes on in the next tile, their ends coincide.
//   pbrt (v3, v4): one cubic Bezier "curve" of type "cylinder" for each strand, whose control
//   points
//     lie on the straight segments, so that the segments are exact; a material for each of ours.
//   BCC (Yuksel's binary curve collection): type C0, uniform Catmull-Rom curves through our points,
//     which is what its readers take; 4-byte integers and floats, three dimensions, z up; no radii.
//   OBJ: a line for each segment, a group for each thread; radii in comments.
//   USDA (text of Universal Scene Description): a BasisCurves of type linear for each material,
//   with
//     the strands' widths and the material's colour; metersPerUnit 0.001, z up.
// Returns the file's bytes. Throws core::Error: kInvalidArgument when tiles has a zero,
// kResourceExhausted over kExportPointLimit.
[[nodiscard]] std::string export_curves(const Tile& tile, const ExportOptions& options);

}  // namespace weft::fabric
