#pragma once

#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/yarn_curve.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// A periodic yarn pattern as MADYPG (Sperl 2021) writes it (.pyp), in the file's own unit.
struct KnitPattern {
  struct Curve {
    std::vector<glm::dvec3> vertices;  // unwrapped; the one after the last is the first, moved on
    glm::ivec2 period{0, 0};
  };
  glm::dvec2 size{0};
  double radius = 0;
  std::vector<Curve> curves;  // by their lowest vertex, each starting there
};

// Reads '*pattern' (size x, size y, radius, number of vertices and edges), '*Q' (x, y, z, twist of
// each vertex; the twist, a degree of freedom of the simulation, is not used) and '*E' (from, to
// and the tiles that the edge crosses along x and y). Other sections, blank lines and what follows
// '#' are skipped. Throws core::Error(kInvalidArgument) naming the line when a number is missing or
// not finite, counts do not agree, an edge names no vertex, or the edges do not join every vertex
// to exactly one before it and one after it.
[[nodiscard]] KnitPattern parse_pyp(std::string_view text);

// The yarns of the pattern in millimetres, as smooth curves through its vertices (Catmull-Rom) with
// nodes close enough together for contacts.
[[nodiscard]] YarnLayout lay_out_curves(const v1::FabricDescription& description);

}  // namespace weft::fabric
