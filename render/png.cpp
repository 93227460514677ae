#include "render/png.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include <png.h>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/input_file.h"
#include "core/sandbox.h"
#include "render/files/png_parser.h"
#include "shading/tone_curve.h"

namespace weft::render {
namespace {

void append(png_structp png, png_bytep data, png_size_t size) {
  auto* out = static_cast<std::string*>(png_get_io_ptr(png));
  out->append(reinterpret_cast<const char*>(data), size);
}

// libpng must not return from its error callback. The exception unwinds its frames, which own
// nothing that png_destroy_write_struct does not free.
[[noreturn]] void fail(png_structp, png_const_charp message) {
  throw core::Error(core::Code::kInternal, std::string("libpng refused the picture: ") + message);
}

class PngWriter {
 public:
  PngWriter() : png_(png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, fail, nullptr)) {
    CHECK(png_ != nullptr);
    info_ = png_create_info_struct(png_);
    CHECK(info_ != nullptr);
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;
  PngWriter(PngWriter&&) = delete;
  PngWriter& operator=(PngWriter&&) = delete;
  [[nodiscard]] png_structp png() const { return png_; }
  [[nodiscard]] png_infop info() const { return info_; }

 private:
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace

PlainPicture read_plain_png(std::string_view bytes, const std::string& name,
                            std::uint32_t side_limit) {
  if (bytes.size() > kPngLimitBytes) {
    throw core::Error(core::Code::kResourceExhausted, name + " is larger than the limit of " +
                                                          std::to_string(kPngLimitBytes) +
                                                          " bytes of such a picture");
  }
  const core::InputFile file(bytes, name);
  const std::uint64_t pixels = std::uint64_t{side_limit} * side_limit;
  const core::SandboxLimits limits{bytes.size() + 4 * pixels + (std::uint64_t{64} << 20),
                                   pixels + (std::uint64_t{1} << 20), 20};
  const core::SandboxAnswer answer =
      core::read_in_sandbox(file, {kPngRequest, name, std::to_string(side_limit)}, limits);
  return plain_picture_from(core::FlatReader(answer.bytes()), side_limit);
}

void write_png(const std::filesystem::path& path, std::uint32_t width, std::uint32_t height,
               std::span<const std::uint8_t> rgb) {
  CHECK(width > 0 && height > 0);
  CHECK_EQ(rgb.size(), std::size_t{3} * width * height);
  std::string bytes;
  {
    const PngWriter writer;
    png_set_write_fn(writer.png(), &bytes, append, nullptr);
    png_set_IHDR(writer.png(), writer.info(), width, height, 8, PNG_COLOR_TYPE_RGB,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(writer.png(), writer.info(), PNG_sRGB_INTENT_PERCEPTUAL);
    png_write_info(writer.png(), writer.info());
    for (std::uint32_t y = 0; y < height; ++y) {
      png_write_row(writer.png(), rgb.data() + std::size_t{3} * width * y);
    }
    png_write_end(writer.png(), writer.info());
  }
  core::write_file_atomically(path, bytes);
}

float srgb_encoded(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

void write_map_png(const std::filesystem::path& path, const MapPicture& picture, glm::vec2 size_mm,
                   const std::map<std::string, std::string>& texts) {
  const std::size_t row = std::size_t{picture.width} * picture.channels;
  CHECK(picture.channels == 3 || picture.channels == 4);
  CHECK(picture.bits == 8 || picture.bits == 16);
  CHECK(size_mm.x > 0 && size_mm.y > 0);
  CHECK_EQ(picture.values.size(), row * picture.height);
  std::string bytes;
  {
    const PngWriter writer;
    png_set_write_fn(writer.png(), &bytes, append, nullptr);
    png_set_IHDR(writer.png(), writer.info(), picture.width, picture.height,
                 static_cast<int>(picture.bits),
                 picture.channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGB_ALPHA,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (picture.is_colour) {
      png_set_sRGB_gAMA_and_cHRM(writer.png(), writer.info(), PNG_sRGB_INTENT_PERCEPTUAL);
    }
    const auto per_metre = [](std::uint32_t pixels, float mm) {
      return static_cast<png_uint_32>(
          std::lround(std::min(1000.0 * pixels / static_cast<double>(mm), 2e9)));
    };
    png_set_pHYs(writer.png(), writer.info(), per_metre(picture.width, size_mm.x),
                 per_metre(picture.height, size_mm.y), PNG_RESOLUTION_METER);
    for (const auto& [key, value] : texts) {
      std::string own_key = key;
      std::string own_value = value;
      png_text text{};
      text.compression = PNG_TEXT_COMPRESSION_NONE;
      text.key = own_key.data();
      text.text = own_value.data();
      png_set_text(writer.png(), writer.info(), &text, 1);  // copied
    }
    png_write_info(writer.png(), writer.info());
    const std::size_t value_bytes = picture.bits / 8;
    const float greatest = picture.bits == 8 ? 255.0f : 65535.0f;
    std::vector<std::uint8_t> packed(row * value_bytes);
    for (std::uint32_t y = 0; y < picture.height; ++y) {
      for (std::size_t i = 0; i < row; ++i) {
        const float value = std::fmin(std::fmax(picture.values[y * row + i], 0.0f), 1.0f);
        const auto number = static_cast<std::uint32_t>(std::lround(greatest * value));
        packed[i * value_bytes] =
            static_cast<std::uint8_t>(value_bytes == 1 ? number : number >> 8);  // big-endian
        if (value_bytes == 2) {
          packed[i * value_bytes + 1] = static_cast<std::uint8_t>(number & 0xff);
        }
      }
      png_write_row(writer.png(), packed.data());
    }
    png_write_end(writer.png(), writer.info());
  }
  core::write_file_atomically(path, bytes);
}

std::vector<std::uint8_t> tone_mapped(const Image& image, float exposure_stops) {
  const float scale = std::exp2(exposure_stops);
  std::vector<std::uint8_t> rgb;
  rgb.reserve(image.pixels.size() * 3);
  for (const glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) {
      const float value = pixel[c] * scale;
      const float shown =
          value > 0 ? srgb_encoded(shading::rolled_off(value)) : 0;  // NaN is not above 0
      rgb.push_back(static_cast<std::uint8_t>(std::lround(255 * std::fmin(shown, 1.0f))));
    }
  }
  return rgb;
}

float automatic_exposure(const Image& image) {
  double sum = 0;
  std::size_t lit = 0;
  for (const glm::vec3& pixel : image.pixels) {
    const float value = std::fmax(pixel.x, std::fmax(pixel.y, pixel.z));
    if (value > 0 && std::isfinite(value)) {
      sum += value;
      ++lit;
    }
  }
  constexpr double kMiddleTone = 0.25;
  return lit == 0 ? 0 : static_cast<float>(std::log2(kMiddleTone * static_cast<double>(lit) / sum));
}

}  // namespace weft::render
