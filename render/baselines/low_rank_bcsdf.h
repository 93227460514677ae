#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "shading/fibre_bcsdf.h"

namespace weft::render {

struct LowRankSettings {
  std::uint32_t rank = 16;  // Tsai and Shih's recommendation; 0: all, undecomposed
  int thetas = 160;         // directions of the matrix: so many longitudes ...
  int phis = 96;            // ... and azimuths, even
  // What the decomposition keeps best. Plain: the entries of S at the grid's directions, as the
  // matrix is written down. Weighted: S cos(theta_i) in the norm of functions on the sphere.
  bool weighted = false;
};

// The longitude of the matrix's grid that is nearest to theta.
[[nodiscard]] float nearest_theta(const LowRankSettings& settings, float theta);

// The BCSDF as Tsai and Shih 2006 keep it: a matrix over directions of light and eye, per channel,
// of which the largest terms of its singular value decomposition stay. As S depends on the
// azimuths' difference alone, the matrix is made of circulant blocks: its singular vectors are
// those of one small matrix per frequency m of azimuth, times cos(m phi) and sin(m phi), which
// makes the exact decomposition of the whole matrix cheap. The two terms of a frequency stay or go
// together.
//
// Their second approximation, sums of spherical Gaussians for the product of a term with
// visibility, is left out: integrals are sums over the grid, which is their scheme with as many
// Gaussians as directions. What remains is the error of the rank.
class LowRankBcsdf {
 public:
  // REQUIRES: positive even `phis`, `thetas` > 1.
  LowRankBcsdf(const shading::FibreBcsdf& bcsdf, const LowRankSettings& settings);

  // One direction of light of the grid, and S cos(theta_i) times its solid angle there.
  struct Entry {
    glm::vec3 omega_i;  // in omega_o-space
    glm::vec3 weight;
  };
  // The matrix's column for an eye at a longitude of the grid: an integral over light is its sum
  // with the light's radiance.
  [[nodiscard]] std::vector<Entry> column(float theta_o) const;

  // Share of the matrix's squared norm that the terms kept hold.
  [[nodiscard]] glm::dvec3 kept_share() const { return kept_share_; }

 private:
  void decompose(const shading::FibreBcsdf& bcsdf, int channel);

  LowRankSettings settings_;
  glm::dvec3 kept_share_{0, 0, 0};
  // [3 channels, frequencies 0 ... phis / 2, thetas (light), thetas (eye)]: what is kept of the
  // cosine series of S.
  std::vector<float> kept_;
};

}  // namespace weft::render
