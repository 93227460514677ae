#include "render/environment.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/error.h"
#include "render/sphere_sampling.h"

namespace weft::render {
namespace {

double luminance(const glm::vec3& rgb) {
  return 0.2126 * static_cast<double>(rgb.x) + 0.7152 * static_cast<double>(rgb.y) +
         0.0722 * static_cast<double>(rgb.z);
}

struct Choice {
  std::uint32_t index;
  double rest;  // uniform again, in [0, 1)
};

// Draws an interval of a cumulative weight with positive total.
Choice choose(std::span<const double> cumulative, double u) {
  const double wanted = u * cumulative.back();
  const auto above = std::upper_bound(cumulative.begin() + 1, cumulative.end() - 1, wanted);
  auto index = static_cast<std::size_t>(above - cumulative.begin()) - 1;
  const double width = cumulative[index + 1] - cumulative[index];
  const double rest = width > 0 ? (wanted - cumulative[index]) / width : 0.5;
  return {static_cast<std::uint32_t>(index), std::clamp(rest, 0.0, 1.0 - 0x1p-53)};
}

}  // namespace

Environment::Environment(const Image& picture, glm::vec3 scale, double turn)
    : picture_(picture), turn_(turn) {
  row_cumulative_.push_back(0);
  for (std::uint32_t y = 0; y < picture_.height; ++y) {
    pixel_cumulative_.push_back(0);
    for (std::uint32_t x = 0; x < picture_.width; ++x) {
      glm::vec3& pixel = picture_.at(x, y);
      for (int c = 0; c < 3; ++c) {
        const float value = pixel[c] * scale[c];
        pixel[c] = std::isfinite(value) && value > 0 ? value : 0.0f;
      }
      pixel_cumulative_.push_back(pixel_cumulative_.back() + luminance(pixel) * solid_angle(y));
    }
    row_cumulative_.push_back(row_cumulative_.back() + pixel_cumulative_.back());
  }
  if (!(row_cumulative_.back() > 0)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the environment is black everywhere; give a picture or a radiance that "
                      "lights something");
  }
}

double Environment::solid_angle(std::uint32_t y) const {
  const double top = kPi * y / picture_.height;
  const double bottom = kPi * (y + 1) / picture_.height;
  return 2.0 * kPi / picture_.width * (std::cos(top) - std::cos(bottom));
}

Environment::Pixel Environment::pixel_of(const glm::dvec3& direction) const {
  // The azimuth from +y towards +x, so that the middle column looks along +y.
  const double azimuth = std::atan2(direction.x, direction.y) + turn_;
  const double turns = azimuth / (2.0 * kPi) + 0.5;
  const double u = turns - std::floor(turns);
  const double v = std::acos(std::clamp(direction.z, -1.0, 1.0)) / kPi;
  return {std::min(static_cast<std::uint32_t>(u * picture_.width), picture_.width - 1),
          std::min(static_cast<std::uint32_t>(v * picture_.height), picture_.height - 1)};
}

glm::vec3 Environment::radiance(const glm::dvec3& direction) const {
  const Pixel pixel = pixel_of(direction);
  return picture_.at(pixel.x, pixel.y);
}

glm::dvec3 Environment::sample(double u1, double u2) const {
  const Choice row = choose(row_cumulative_, u1);
  const std::size_t stride = picture_.width + std::size_t{1};
  const Choice column =
      choose(std::span(pixel_cumulative_).subspan(row.index * stride, stride), u2);
  const double cos_top = std::cos(kPi * row.index / picture_.height);
  const double cos_bottom = std::cos(kPi * (row.index + 1) / picture_.height);
  const double cos_theta = cos_top + row.rest * (cos_bottom - cos_top);
  const double sin_theta = std::sqrt(std::fmax(0.0, 1.0 - cos_theta * cos_theta));
  const double azimuth = 2.0 * kPi * ((column.index + column.rest) / picture_.width - 0.5) - turn_;
  return {sin_theta * std::sin(azimuth), sin_theta * std::cos(azimuth), cos_theta};
}

double Environment::pdf(const glm::dvec3& direction) const {
  const Pixel pixel = pixel_of(direction);
  return luminance(picture_.at(pixel.x, pixel.y)) / row_cumulative_.back();
}

}  // namespace weft::render
