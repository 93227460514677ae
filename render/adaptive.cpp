#include "render/adaptive.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <glm/geometric.hpp>

#include "core/check.h"

namespace weft::render {

namespace {

constexpr int kAround = 2;  // pixels to each side whose samples count
// Of the picture's brightness: what is darker is as noisy as if it were so bright.
constexpr double kDarkest = 0.01;

// Of the three channels, their mean.
struct Spread {
  double brightness = 0;
  double variance = 0;  // of one sample
};

double mean_channel(const glm::dvec3& v) { return (v.x + v.y + v.z) / 3; }

Spread spread_of(const PixelSums& sums) {
  const double count = sums.samples;
  const glm::dvec3 mean = sums.radiance / count;
  const glm::dvec3 variance = (sums.squared - sums.radiance * mean) / (count - 1);
  return {mean_channel(mean), std::fmax(0.0, mean_channel(variance))};
}

// The mean over the neighbours of a pixel.
Spread spread_around(const std::vector<Spread>& spreads, const AdaptiveSampling& settings, int x,
                     int y) {
  const int right = static_cast<int>(settings.width) - 1;
  const int bottom = static_cast<int>(settings.height) - 1;
  Spread sum;
  int count = 0;
  for (int v = std::max(0, y - kAround); v <= std::min(bottom, y + kAround); ++v) {
    for (int u = std::max(0, x - kAround); u <= std::min(right, x + kAround); ++u) {
      if (u != x || v != y) {
        const Spread& one =
            spreads[static_cast<std::size_t>(v) * settings.width + static_cast<std::size_t>(u)];
        sum.brightness += one.brightness;
        sum.variance += one.variance;
        ++count;
      }
    }
  }
  return count > 0 ? Spread{sum.brightness / count, sum.variance / count} : Spread{};
}

}  // namespace

std::vector<std::uint32_t> samples_by_pixel(const std::vector<PixelSums>& pilot,
                                            const AdaptiveSampling& settings) {
  CHECK_EQ(pilot.size(), std::size_t{settings.width} * settings.height);
  CHECK(settings.target_error > 0 && settings.most_samples >= kPilotSamples);
  std::vector<Spread> spreads;
  spreads.reserve(pilot.size());
  double picture = 0;
  for (const PixelSums& sums : pilot) {
    CHECK_EQ(sums.samples, kPilotSamples);
    spreads.push_back(spread_of(sums));
    picture += spreads.back().brightness / static_cast<double>(pilot.size());
  }
  std::vector<std::uint32_t> samples;
  samples.reserve(pilot.size());
  for (int y = 0; y < static_cast<int>(settings.height); ++y) {
    for (int x = 0; x < static_cast<int>(settings.width); ++x) {
      const Spread around = spread_around(spreads, settings, x, y);
      const double allowed = settings.target_error * settings.target_error * picture *
                             std::fmax(around.brightness, kDarkest * picture);
      const double needed = allowed > 0 ? std::ceil(around.variance / allowed) : 0;
      samples.push_back(static_cast<std::uint32_t>(
          std::clamp<double>(needed, kPilotSamples, settings.most_samples)));
    }
  }
  return samples;
}

}  // namespace weft::render
