#include "render/compare.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <glm/common.hpp>

#include "core/check.h"
#include "core/error.h"

namespace weft::render {
namespace {

bool is_finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

double mean_difference(const glm::vec3& a, const glm::vec3& b) {
  const glm::dvec3 d = glm::dvec3(a) - glm::dvec3(b);
  return (d.x + d.y + d.z) / 3;
}

std::string size_of(const Image& image) {
  return std::to_string(image.width) + " x " + std::to_string(image.height);
}

}  // namespace

Comparison compare(const Image& image, const Image& reference) {
  if (image.width != reference.width || image.height != reference.height) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the pictures differ in size, " + size_of(image) + " against " +
                          size_of(reference) + " pixels; draw both with the same --size");
  }
  Comparison result;
  glm::dvec3 sum(0);
  glm::dvec3 reference_sum(0);
  glm::dvec3 squares(0);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (!is_finite(image.pixels[i]) || !is_finite(reference.pixels[i])) {
      ++result.non_finite_pixels;
      continue;
    }
    ++result.pixels;
    const glm::dvec3 a(image.pixels[i]);
    const glm::dvec3 b(reference.pixels[i]);
    sum += a;
    reference_sum += b;
    squares += (a - b) * (a - b);
    result.largest_difference = glm::max(result.largest_difference, glm::abs(a - b));
  }
  if (result.pixels == 0) {
    throw core::Error(core::Code::kInvalidArgument,
                      "no pixel is finite in both pictures; there is nothing to compare");
  }
  const auto count = static_cast<double>(result.pixels);
  result.mean = sum / count;
  result.reference_mean = reference_sum / count;
  result.rmse_all = std::sqrt((squares.x + squares.y + squares.z) / (3 * count));
  for (int c = 0; c < 3; ++c) {
    result.rmse[c] = std::sqrt(squares[c] / count);
    if (result.reference_mean[c] != 0) {
      result.relative_mean_error[c] =
          (result.mean[c] - result.reference_mean[c]) / result.reference_mean[c];
    }
  }
  return result;
}

std::vector<std::uint8_t> difference_picture(const Image& image, const Image& reference,
                                             double full_scale) {
  CHECK(full_scale > 0);
  CHECK_EQ(image.pixels.size(), reference.pixels.size());
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * image.pixels.size());
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (!is_finite(image.pixels[i]) || !is_finite(reference.pixels[i])) {
      rgb.insert(rgb.end(), {0, 255, 0});
      continue;
    }
    const double difference = mean_difference(image.pixels[i], reference.pixels[i]) / full_scale;
    const auto level = static_cast<std::uint8_t>(
        std::lround(255 * std::sqrt(std::fmin(1.0, std::fabs(difference)))));
    const auto pale = static_cast<std::uint8_t>(level / 4);
    if (difference > 0) {
      rgb.insert(rgb.end(), {level, pale, 0});
    } else {
      rgb.insert(rgb.end(), {0, pale, level});
    }
  }
  return rgb;
}

double natural_scale(const Image& image, const Image& reference) {
  CHECK_EQ(image.pixels.size(), reference.pixels.size());
  std::vector<double> differences;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (is_finite(image.pixels[i]) && is_finite(reference.pixels[i])) {
      differences.push_back(std::fabs(mean_difference(image.pixels[i], reference.pixels[i])));
    }
  }
  if (differences.empty()) {
    return 1;
  }
  const auto rank = static_cast<std::ptrdiff_t>(differences.size() * 99 / 100);
  std::nth_element(differences.begin(), differences.begin() + rank, differences.end());
  const double scale = differences[static_cast<std::size_t>(rank)];
  const double largest = *std::max_element(differences.begin(), differences.end());
  return scale > 0 ? scale : (largest > 0 ? largest : 1);
}

}  // namespace weft::render
