#include "coordinator/web/png.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <png.h>

#include "core/check.h"
#include "core/error.h"
#include "shading/tone_curve.h"

namespace weft::coordinator {

namespace {

constexpr double kMiddleTone = 0.25;  // linear
constexpr float kWhite = 65535;       // of libpng's 16-bit linear samples

png_uint_16 sample_of(float value) {
  return value > 0 ? static_cast<png_uint_16>(
                         std::lround(kWhite * std::fmin(shading::rolled_off(value), 1)))
                   : png_uint_16{0};  // NaN is not above 0
}

}  // namespace

float automatic_exposure(std::span<const float> rgb) {
  double sum = 0;
  std::size_t lit = 0;
  for (std::size_t i = 0; i + 2 < rgb.size(); i += 3) {
    const float value = std::fmax(rgb[i], std::fmax(rgb[i + 1], rgb[i + 2]));
    if (value > 0 && std::isfinite(value)) {
      sum += value;
      ++lit;
    }
  }
  return lit == 0 ? 0 : static_cast<float>(std::log2(kMiddleTone * static_cast<double>(lit) / sum));
}

std::string png_of(std::span<const float> rgb, std::uint32_t width, std::uint32_t height,
                   float exposure_stops) {
  CHECK(width > 0 && height > 0);
  CHECK_EQ(rgb.size(), std::size_t{3} * width * height);
  const float scale = std::exp2(exposure_stops);
  std::vector<png_uint_16> linear(rgb.size());
  std::transform(rgb.begin(), rgb.end(), linear.begin(),
                 [scale](float value) { return sample_of(value * scale); });

  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = width;
  image.height = height;
  image.format = PNG_FORMAT_LINEAR_RGB;
  constexpr int kAsSrgb = 1;  // 8 bits, encoded by libpng
  png_alloc_size_t size = 0;
  std::string bytes;
  bool is_done =
      png_image_write_to_memory(&image, nullptr, &size, kAsSrgb, linear.data(), 0, nullptr) != 0;
  if (is_done) {
    bytes.resize(size);
    is_done = png_image_write_to_memory(&image, bytes.data(), &size, kAsSrgb, linear.data(), 0,
                                        nullptr) != 0;
    bytes.resize(size);
  }
  if (!is_done) {
    throw core::Error(core::Code::kInternal,
                      std::string("libpng refused the picture: ") + image.message);
  }
  return bytes;
}

}  // namespace weft::coordinator
