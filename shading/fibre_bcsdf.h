#pragma once

#include <memory>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "shading/bcsdf.h"
#include "shading/fibre_angle.h"  // fibre_frame
#include "shading/fibre_material.h"

namespace weft::shading {

struct BcsdfSample {
  glm::vec3 omega_i;  // towards the light, local frame
  glm::vec3 weight;   // S(omega_i, omega_o) cos(theta_i) / pdf; may exceed 1 (S is not reciprocal)
  float pdf;          // per solid angle; 0: no sample, the path ends
};

// How many paths go on from a fibre by either lobe, in the mean.
struct LobeOdds {
  float r = 0;
  float tt = 0;
  FibreAngle o{};  // of omega_o
  float row = 0;   // where the tables are read for it

  // The same, scaled where they sum to more than `most`.
  [[nodiscard]] LobeOdds at_most(float most) const {
    LobeOdds scaled = *this;
    if (const float sum = r + tt; sum > most) {
      scaled.r *= most / sum;
      scaled.tt = most - scaled.r;
    }
    return scaled;
  }
};

// Both lobes for one pair of directions: S_l cos(theta_i), and the density per solid angle in which
// scatter() draws omega_i where it goes on by that lobe.
struct LobeDensities {
  glm::vec3 r{0};
  glm::vec3 tt{0};
  float pdf_r = 0;
  float pdf_tt = 0;
};

// Where a path goes on, and with what throughput.
struct BcsdfStep {
  glm::vec3 omega_i{};     // towards the light, local frame
  glm::vec3 throughput{};  // that of before times S_l(omega_i, omega_o) cos(theta_i) / pdf_l / odds
  bool survives = false;   // else the path ends, and the others mean nothing
};

// S = S_R + S_TT with the tables that evaluate and sample it fast. Directions are unit vectors that
// point away from the fibre, in any frame whose x axis is the fibre's tangent; omega_i is the light
// side (S is not reciprocal). Immutable after construction: any thread may call.
class FibreBcsdf {
 public:
  // REQUIRES: widths above 1e-3 rad, colours in [0, 1] (descriptions are checked before).
  explicit FibreBcsdf(const FibreMaterial& material);
  // The test lobe S = 1 / pi^2, sampled by cos^2(theta): every weight is 1 (a furnace for paths).
  [[nodiscard]] static FibreBcsdf furnace();

  [[nodiscard]] const FibreMaterial& material() const;
  [[nodiscard]] bool is_furnace() const;
  // What the shared kernels need (bcsdf.h, gamma.h); its table lives as long as this object or a
  // copy of it.
  [[nodiscard]] const FibreLobes& lobes() const;

  // S in 1/sr, without the cosine.
  [[nodiscard]] glm::vec3 evaluate(glm::vec3 omega_i, glm::vec3 omega_o) const;
  // S cos(theta_i).
  [[nodiscard]] glm::vec3 evaluate_cos(glm::vec3 omega_i, glm::vec3 omega_o) const;
  // omega_i given omega_o by three uniform numbers in [0, 1): lobe, theta, phi.
  [[nodiscard]] BcsdfSample sample(glm::vec3 omega_o, float u_lobe, float u_theta,
                                   float u_phi) const;
  // The odds that leave the largest channel of either lobe at one: that channel of `throughput`
  // times the lobe's adjoint albedo. With them no channel grows from scattering to scattering, as
  // it does where sample() picks lobes of coloured or bright fibres by their luminance. They may
  // sum to more than one.
  [[nodiscard]] LobeOdds odds(glm::vec3 omega_o, glm::vec3 throughput) const;
  // Goes on by the reflection lobe where u.x is below odds.r, by the transmission lobe where it is
  // below odds.r + odds.tt, else ends. For any positive odds, u.x uniform in [0, 1) and their sum
  // at most one, the expectation of f(omega_i) throughput over what survives is that of before
  // times the integral of S cos f. Where the sum is larger, that holds for all of u.x, u.x + 1, ...
  // together. u.y and u.z, in [0, 1), draw theta and phi.
  [[nodiscard]] BcsdfStep scatter(glm::vec3 omega_o, const LobeOdds& odds, glm::vec3 throughput,
                                  glm::vec3 u) const;
  // `odds` are those of omega_o, whatever they were scaled by.
  [[nodiscard]] LobeDensities densities(glm::vec3 omega_i, glm::vec3 omega_o,
                                        const LobeOdds& odds) const;
  // The density that sample() draws from.
  [[nodiscard]] float pdf(glm::vec3 omega_i, glm::vec3 omega_o) const;
  // Integral of S cos(theta_i) over omega_i (maths of W17's ambient term); theta_o in radians.
  [[nodiscard]] glm::vec3 adjoint_albedo(float theta_o) const;

 private:
  struct Tables;
  FibreBcsdf() = default;
  std::shared_ptr<const Tables> tables_;  // shared: immutable and large, copies are common
};

}  // namespace weft::shading
