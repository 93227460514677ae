#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <glm/vec3.hpp>

#include "render/sky_grid.h"

namespace weft::render {

inline constexpr double kLeastSharpness = 1e-4;  // constant to 1e-4 over the sphere
inline constexpr double kMostSharpness = 20000;

// A term of the fit: its radiance is amplitude G(omega; axis, sharpness).
struct SkyGaussian {
  glm::vec3 axis{0, 0, 1};
  double sharpness = 1;
  glm::dvec3 amplitude{0};
  std::vector<float> values;      // of the smoothed Gaussian of amplitude 1, on the grid
  shading::ShVector harmonics{};  // the same, projected over the directions of the grid
};

// Fits a sum of spherical Gaussians to a sky. They are added one by one, each where it explains
// most of what is left (as Lawson and Hanson choose columns), then its axis and sharpness are
// searched for; amplitudes are non-negative least squares for each channel. The harmonics up to
// order 5 count extra: they are what multiple scattering sees, and the first is the energy.
class SkyFitter {
 public:
  // REQUIRES: the sky is not black. Keeps a reference to `grid`.
  explicit SkyFitter(const SkyGrid& grid);

  void run(std::size_t most_gaussians);

  [[nodiscard]] const std::vector<SkyGaussian>& gaussians() const { return gaussians_; }
  [[nodiscard]] const std::vector<glm::vec3>& residual() const { return residual_; }
  // Root mean square of the residual over that of the sky.
  [[nodiscard]] double relative_error() const;

 private:
  struct Match {
    double gain;  // by how much the squared residual falls
    glm::dvec3 amplitude;
  };
  [[nodiscard]] bool upper_half() const { return grid_.rows < SkyGrid::kRows; }
  void add_starts();
  [[nodiscard]] Match match(const glm::vec3& axis, double sharpness) const;
  [[nodiscard]] SkyGaussian best_start() const;
  void search(SkyGaussian& g) const;
  void take_values(std::size_t k);
  void solve();
  void drop(std::size_t k);
  void take_residual();
  void add_to_residual(const SkyGaussian& g, float sign);
  void sweep();
  void keep_energy();

  const SkyGrid& grid_;
  std::array<shading::ShVector, 3> harmonics_;        // of the sky
  std::array<double, shading::kShMaxCount> weights_;  // of the harmonics
  double squared_ = 0;                                // of the sky
  std::vector<SkyGaussian> starts_;
  std::vector<SkyGaussian> gaussians_;
  std::vector<std::vector<double>> gram_;  // [n, n]
  std::vector<glm::vec3> residual_;
};

}  // namespace weft::render
