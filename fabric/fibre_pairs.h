#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "core/parallel.h"
#include "fabric/fibre_body.h"

namespace weft::fabric {

// Piece u near piece v of the copy of the tile `copy` tiles away.
struct FibrePair {
  std::uint32_t u = 0;
  std::uint32_t v = 0;
  glm::ivec2 copy{0, 0};
};

// Where two straight pieces come closest: shares of their lengths, and from u's place to v's.
struct Approach {
  double at_u = 0;
  double at_v = 0;
  glm::dvec3 gap_mm{0};
};

// Approaches of many pairs, worked out side by side in vector registers.
class Approaches {
 public:
  static constexpr std::size_t kCount = 64;

  // Of the first kCount of `pairs` or of all: as many as are returned.
  std::size_t measure(const FibreBody& body, std::span<const FibrePair> pairs);
  // Of the last call's pair `i`.
  [[nodiscard]] double gap2(std::size_t i) const { return gap2_[i]; }  // mm^2
  [[nodiscard]] Approach operator[](std::size_t i) const {
    return {at_u_[i], at_v_[i], {gap_[0][i], gap_[1][i], gap_[2][i]}};
  }

 private:
  using Numbers = std::array<double, kCount>;
  using Vectors = std::array<Numbers, 3>;  // x, y, z

  Vectors p_{};  // begin of u
  Vectors q_{};  // begin of v
  Vectors along_u_{};
  Vectors along_v_{};
  Vectors gap_{};
  Numbers at_u_{};
  Numbers at_v_{};
  Numbers gap2_{};
};

// All pairs of pieces of different fibres whose surfaces are closer than `margin_mm`, each once and
// in a fixed order. A strand and itself are one fibre, also where it goes on in the next tile; its
// lateral copies are other fibres. The same ones on any number of threads.
[[nodiscard]] std::vector<FibrePair> close_pairs(const FibreBody& body, double margin_mm,
                                                 unsigned most_threads = core::kAllCores);

}  // namespace weft::fabric
