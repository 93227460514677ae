#include "render/sky_fitter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render/nonnegative_least_squares.h"
#include "render/sphere_sampling.h"
#include "shading/visibility.h"

namespace weft::render {
namespace {

// How often an error of the energy, and of the other harmonics, counts against one of the radiance.
constexpr double kEnergyWeight = 100;
constexpr double kHarmonicWeight = 25;
constexpr double kGoodEnough = 1e-3;  // relative error at which no Gaussian is added
constexpr int kLastSweeps = 4;        // of moving every Gaussian
constexpr std::size_t kSweepEvery = 8;
constexpr int kMostFruitless = 4;   // additions after which one was dropped
constexpr double kFirstStep = 0.5;  // of the search, in widths of a Gaussian
constexpr double kLastStep = 0.01;

// Where a Gaussian may start: axes all over the sphere, about a width apart, and the brightest bin
// of what is left.
constexpr std::array<double, 4> kLevels = {2, 8, 32, 128};
constexpr double kAxesPerSharpness = 4;
constexpr int kFewestAxes = 12;
constexpr std::array<double, 4> kPeakLevels = {128, 512, 2048, kMostSharpness};

// On the grid a Gaussian is smoothed as the picture is; bins smooth too.
double seen_sharpness(double sharpness) {
  return 1 / (1 / sharpness + 1 / SkyGrid::kSmoothing + SkyGrid::kBin * SkyGrid::kBin / 12);
}

// Calls visit(bin, value) where the smoothed Gaussian is not negligible.
template <class Visit>
void for_each_value(const SkyGrid& grid, const glm::vec3& axis, double sharpness,
                    const Visit& visit) {
  const double seen = seen_sharpness(sharpness);
  const auto scale = static_cast<float>(sg_mass(sharpness) / sg_mass(seen));
  const auto narrow = static_cast<float>(seen);
  const SkyBins bins = bins_about(grid, axis, seen);
  for (std::size_t i = bins.first; i < bins.last; ++i) {
    const float cosine = glm::dot(grid.directions[i], axis);
    if (cosine > bins.least_cosine) {
      visit(i, scale * std::exp(narrow * (cosine - 1)));
    }
  }
}

}  // namespace

SkyFitter::SkyFitter(const SkyGrid& grid) : grid_(grid), residual_(grid.radiance) {
  harmonics_.fill(shading::sh_zero());
  for (std::size_t i = 0; i < grid_.radiance.size(); ++i) {
    const glm::vec3& radiance = grid_.radiance[i];
    squared_ += static_cast<double>(grid_.solid_angles[i] * glm::dot(radiance, radiance));
    for (std::size_t j = 0; j < shading::kShMaxCount; ++j) {
      for (std::size_t c = 0; c < 3; ++c) {
        harmonics_[c].c[j] += grid_.harmonics[i].c[j] * radiance[static_cast<glm::length_t>(c)];
      }
    }
  }
  weights_.fill(kHarmonicWeight);
  weights_[0] = kEnergyWeight;
  add_starts();
}

void SkyFitter::add_starts() {
  SkyGaussian everywhere;
  everywhere.sharpness = kLeastSharpness;
  starts_.push_back(everywhere);
  for (const double level : kLevels) {
    const int count = std::max(kFewestAxes, static_cast<int>(kAxesPerSharpness * level));
    for (int q = 0; q < count; ++q) {
      SkyGaussian start;
      start.axis = shading::fibonacci_axis_sphere(q, count, 0);
      start.sharpness = level;
      if (!upper_half() || start.axis.z > 0) {
        starts_.push_back(std::move(start));
      }
    }
  }
}

void SkyFitter::run(std::size_t most_gaussians) {
  int fruitless = 0;
  while (gaussians_.size() < most_gaussians && relative_error() > kGoodEnough) {
    SkyGaussian best = best_start();
    search(best);
    if (best.amplitude == glm::dvec3(0)) {
      break;
    }
    gaussians_.push_back(std::move(best));
    const std::size_t count = gaussians_.size();
    gram_.emplace_back();
    take_values(count - 1);
    solve();
    if (count % kSweepEvery == 0) {
      sweep();
    }
    fruitless += gaussians_.size() < count ? 1 : 0;
    if (fruitless > kMostFruitless) {
      break;
    }
  }
  for (int i = 0; i < kLastSweeps && relative_error() > kGoodEnough; ++i) {
    sweep();
  }
  keep_energy();
}

double SkyFitter::relative_error() const {
  double left = 0;
  for (std::size_t i = 0; i < residual_.size(); ++i) {
    left += static_cast<double>(grid_.solid_angles[i] * glm::dot(residual_[i], residual_[i]));
  }
  return std::sqrt(left / squared_);
}

// How well a Gaussian explains what is left, with the best amplitude of each channel.
SkyFitter::Match SkyFitter::match(const glm::vec3& axis, double sharpness) const {
  glm::dvec3 projected(0);
  double squared = 0;
  for_each_value(grid_, axis, sharpness, [&](std::size_t i, float value) {
    const float weighted = grid_.solid_angles[i] * value;
    projected += glm::dvec3(weighted * residual_[i]);
    squared += static_cast<double>(weighted * value);
  });
  projected = glm::max(projected, glm::dvec3(0));
  if (!(squared > 0)) {
    return {0, glm::dvec3(0)};
  }
  return {glm::dot(projected, projected) / squared, projected / squared};
}

SkyGaussian SkyFitter::best_start() const {
  std::size_t brightest = 0;
  for (std::size_t i = 1; i < residual_.size(); ++i) {
    const auto grey = [&](std::size_t at) {
      return residual_[at].x + residual_[at].y + residual_[at].z;
    };
    brightest = grey(i) > grey(brightest) ? i : brightest;
  }
  SkyGaussian best = starts_.front();
  double best_gain = 0;
  const auto consider = [&](const glm::vec3& axis, double sharpness) {
    const double gain = match(axis, sharpness).gain;
    if (gain > best_gain) {
      best_gain = gain;
      best.axis = axis;
      best.sharpness = sharpness;
    }
  };
  for (const SkyGaussian& start : starts_) {
    consider(start.axis, start.sharpness);
  }
  for (const double level : kPeakLevels) {
    consider(grid_.directions[brightest], level);
  }
  return best;
}

// Pattern search over axis and sharpness for the largest gain; sets the amplitude to match.
void SkyFitter::search(SkyGaussian& g) const {
  Match best = match(g.axis, g.sharpness);
  for (double step = kFirstStep; step > kLastStep;) {
    bool moved = false;
    for (int way = 0; way < 6; ++way) {
      const double sign = way % 2 == 0 ? 1 : -1;
      glm::vec3 axis = g.axis;
      double sharpness = g.sharpness;
      if (way < 4) {
        const glm::dvec3 side(way < 2 ? sign : 0, way < 2 ? 0 : sign, 0);
        const glm::dvec3 from = glm::normalize(glm::dvec3(g.axis));
        const double width = 1 / std::sqrt(std::max(1.0, g.sharpness));
        axis = glm::vec3(glm::normalize(from + step * width * from_local(side, from)));
      } else {
        sharpness =
            std::clamp(g.sharpness * std::exp2(2 * sign * step), kLeastSharpness, kMostSharpness);
      }
      const Match found = match(axis, sharpness);
      if (found.gain > best.gain * (1 + 1e-9)) {
        best = found;
        g.axis = axis;
        g.sharpness = sharpness;
        moved = true;
      }
    }
    step = moved ? step : step / 2;
  }
  g.amplitude = best.amplitude;
}

// The grid's values of Gaussian k, its harmonics, and its products with all others.
void SkyFitter::take_values(std::size_t k) {
  SkyGaussian& g = gaussians_[k];
  g.values.assign(residual_.size(), 0.0f);
  std::array<double, shading::kShMaxCount> harmonics{};
  for_each_value(grid_, g.axis, g.sharpness, [&](std::size_t i, float value) {
    g.values[i] = value;
    for (std::size_t j = 0; j < harmonics.size(); ++j) {
      harmonics[j] += static_cast<double>(value * grid_.harmonics[i].c[j]);
    }
  });
  for (std::size_t j = 0; j < harmonics.size(); ++j) {
    g.harmonics.c[j] = static_cast<float>(harmonics[j]);
  }
  gram_[k].resize(gaussians_.size());
  const SkyBins bins = bins_about(grid_, g.axis, seen_sharpness(g.sharpness));
  for (std::size_t j = 0; j < gaussians_.size(); ++j) {
    const SkyGaussian& other = gaussians_[j];
    double sum = 0;
    for (std::size_t i = bins.first; i < bins.last && i < other.values.size(); ++i) {
      sum += static_cast<double>(grid_.solid_angles[i] * g.values[i] * other.values[i]);
    }
    for (std::size_t h = 0; h < weights_.size(); ++h) {
      sum += weights_[h] * static_cast<double>(g.harmonics.c[h] * other.harmonics.c[h]);
    }
    gram_[j].resize(gaussians_.size());
    gram_[k][j] = gram_[j][k] = sum;
  }
}

// All amplitudes at once, and what is then left. Gaussians that explain nothing are dropped.
void SkyFitter::solve() {
  const std::size_t n = gaussians_.size();
  std::vector<double> gram;
  for (const std::vector<double>& row : gram_) {
    gram.insert(gram.end(), row.begin(), row.end());
  }
  for (glm::length_t c = 0; c < 3; ++c) {
    const shading::ShVector& sky = harmonics_[static_cast<std::size_t>(c)];
    std::vector<double> projected(n);
    for (std::size_t k = 0; k < n; ++k) {
      const SkyGaussian& g = gaussians_[k];
      double sum = 0;
      for (std::size_t i = 0; i < residual_.size(); ++i) {
        sum += static_cast<double>(grid_.solid_angles[i] * g.values[i] * grid_.radiance[i][c]);
      }
      for (std::size_t h = 0; h < weights_.size(); ++h) {
        sum += weights_[h] * static_cast<double>(g.harmonics.c[h] * sky.c[h]);
      }
      projected[k] = sum;
    }
    const std::vector<double> amplitudes = nonnegative_least_squares(gram, projected);
    for (std::size_t k = 0; k < n; ++k) {
      gaussians_[k].amplitude[c] = amplitudes[k];
    }
  }
  for (std::size_t k = n; k-- > 0;) {
    if (gaussians_[k].amplitude == glm::dvec3(0)) {
      drop(k);
    }
  }
  take_residual();
}

void SkyFitter::drop(std::size_t k) {
  const auto at = static_cast<std::ptrdiff_t>(k);
  gaussians_.erase(gaussians_.begin() + at);
  gram_.erase(gram_.begin() + at);
  for (std::vector<double>& row : gram_) {
    row.erase(row.begin() + at);
  }
}

void SkyFitter::take_residual() {
  residual_ = grid_.radiance;
  for (const SkyGaussian& g : gaussians_) {
    add_to_residual(g, -1);
  }
}

void SkyFitter::add_to_residual(const SkyGaussian& g, float sign) {
  const glm::vec3 amplitude = sign * glm::vec3(g.amplitude);
  for (std::size_t i = 0; i < residual_.size(); ++i) {
    residual_[i] += g.values[i] * amplitude;
  }
}

// Moves each Gaussian to where it explains most of what the others leave.
void SkyFitter::sweep() {
  for (std::size_t k = 0; k < gaussians_.size(); ++k) {
    add_to_residual(gaussians_[k], 1);
    search(gaussians_[k]);
    take_values(k);
    add_to_residual(gaussians_[k], -1);
  }
  solve();
}

// The amplitudes keep the energy nearly; now exactly.
void SkyFitter::keep_energy() {
  for (std::size_t c = 0; c < 3; ++c) {
    const auto channel = static_cast<glm::length_t>(c);
    double kept = 0;
    for (const SkyGaussian& g : gaussians_) {
      kept += g.amplitude[channel] * static_cast<double>(g.harmonics.c[0]);
    }
    for (SkyGaussian& g : gaussians_) {
      g.amplitude[channel] *= kept > 0 ? static_cast<double>(harmonics_[c].c[0]) / kept : 1;
    }
  }
  take_residual();
}

}  // namespace weft::render
