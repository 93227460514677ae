#include "render/similarity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/error.h"
#include "render/png.h"

namespace weft::render {
namespace {

constexpr int kRadius = 5;
constexpr double kDeviation = 1.5;
constexpr double kC1 = 0.01 * 255 * 0.01 * 255;
constexpr double kC2 = 0.03 * 255 * 0.03 * 255;

// One number per pixel.
struct Plane {
  int width;
  int height;
  std::vector<double> values;
};

Plane luma_of(const Image& image, float exposure_stops) {
  const std::vector<std::uint8_t> rgb = tone_mapped(image, exposure_stops);
  Plane plane{static_cast<int>(image.width), static_cast<int>(image.height), {}};
  plane.values.reserve(image.pixels.size());
  for (std::size_t i = 0; i < rgb.size(); i += 3) {
    plane.values.push_back(0.2126 * rgb[i] + 0.7152 * rgb[i + 1] + 0.0722 * rgb[i + 2]);
  }
  return plane;
}

Plane product(const Plane& a, const Plane& b) {
  Plane result{a.width, a.height, a.values};
  for (std::size_t i = 0; i < b.values.size(); ++i) {
    result.values[i] *= b.values[i];
  }
  return result;
}

// The Gaussian mean about every pixel, along x or along y; the border repeats.
Plane smoothed_along(const Plane& plane, int step_x, int step_y) {
  std::array<double, 2 * kRadius + 1> weights{};
  double total = 0;
  for (int k = -kRadius; k <= kRadius; ++k) {
    const double w = std::exp(-0.5 * k * k / (kDeviation * kDeviation));
    weights[static_cast<std::size_t>(k + kRadius)] = w;
    total += w;
  }
  Plane result{plane.width, plane.height, {}};
  result.values.reserve(plane.values.size());
  for (int y = 0; y < plane.height; ++y) {
    for (int x = 0; x < plane.width; ++x) {
      double sum = 0;
      for (int k = -kRadius; k <= kRadius; ++k) {
        const int from_x = std::clamp(x + k * step_x, 0, plane.width - 1);
        const int from_y = std::clamp(y + k * step_y, 0, plane.height - 1);
        sum += weights[static_cast<std::size_t>(k + kRadius)] *
               plane.values[static_cast<std::size_t>(from_y * plane.width + from_x)];
      }
      result.values.push_back(sum / total);
    }
  }
  return result;
}

Plane smoothed(const Plane& plane) { return smoothed_along(smoothed_along(plane, 1, 0), 0, 1); }

}  // namespace

double structural_similarity(const Image& image, const Image& reference) {
  if (image.width != reference.width || image.height != reference.height || image.pixels.empty()) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the pictures are not of the same size; draw both with the same --size");
  }
  const float exposure = automatic_exposure(reference);
  const Plane a = luma_of(image, exposure);
  const Plane b = luma_of(reference, exposure);
  const Plane mean_a = smoothed(a);
  const Plane mean_b = smoothed(b);
  const Plane square_a = smoothed(product(a, a));
  const Plane square_b = smoothed(product(b, b));
  const Plane mixed = smoothed(product(a, b));
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double ma = mean_a.values[i];
    const double mb = mean_b.values[i];
    const double variances = square_a.values[i] - ma * ma + square_b.values[i] - mb * mb;
    const double covariance = mixed.values[i] - ma * mb;
    sum += (2 * ma * mb + kC1) * (2 * covariance + kC2) /
           ((ma * ma + mb * mb + kC1) * (variances + kC2));
  }
  return sum / static_cast<double>(a.values.size());
}

}  // namespace weft::render
