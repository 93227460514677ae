#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/yarn_curve.h"

namespace weft::fabric {

// The nodes of all curves of a layout side by side, with the frames of their sections.
struct YarnBody {
  struct Curve {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
    glm::dvec3 period_mm{0};
    glm::ivec2 period{0, 0};
    double spacing_mm = 0;  // between its nodes, on average, as laid out
    double radius_mm = 0;
    double flattening = 0;
    Role role = Role::kCurve;
  };
  glm::dvec2 size_mm{0};
  std::vector<Curve> curves;
  std::vector<std::uint32_t> curve_of;  // [node]
  std::vector<glm::dvec3> centres_mm;
  std::vector<glm::dvec3> laterals;
  std::vector<glm::dvec3> normals;
  std::vector<double> half_widths_mm;
  std::vector<double> half_heights_mm;

  explicit YarnBody(const YarnLayout& layout);
  // Recomputes laterals and normals from the centres.
  void update_frames();
  // Moves the nodes back into the layout that the body was made of.
  void write_to(YarnLayout& layout) const;
  // The node after (or before) `node` on its curve by `steps`, and by how much it must be moved to
  // lie there.
  struct Neighbour {
    std::uint32_t node = 0;
    glm::dvec3 shift_mm{0};
  };
  [[nodiscard]] Neighbour neighbour(std::uint32_t node, int steps) const;
};

// Piece u of a curve (from node u to the next) near piece v moved by shift_mm.
struct NearPair {
  std::uint32_t u = 0;
  std::uint32_t v = 0;
  glm::dvec3 shift_mm{0};
};

// All pairs of pieces whose sections might touch after moving `margin_mm` towards each other, each
// pair once, in a fixed order. Pieces of the same curve that lie close along it are left out.
[[nodiscard]] std::vector<NearPair> near_pairs(const YarnBody& body, double margin_mm);

// Where two pieces are closest. Both sections reach `overlap_mm` too far along the unit normal
// (from u to v); negative: a gap. For elliptical tubes the normal is chosen so that the overlap is
// an upper bound: two bodies on their sides of a plane do not overlap.
struct Contact {
  double overlap_mm = 0;
  double at_u = 0;  // shares of the pieces, 0 to 1
  double at_v = 0;
  glm::dvec3 normal{0};
};
[[nodiscard]] Contact contact_of(const YarnBody& body, const NearPair& pair);

}  // namespace weft::fabric
