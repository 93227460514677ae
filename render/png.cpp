#include "render/png.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include <png.h>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"

namespace weft::render {
namespace {

constexpr float kShoulder = 0.8f;  // below it tones are kept as they are

float rolled_off(float value) {
  if (value <= kShoulder) {
    return value;
  }
  const float room = 1 - kShoulder;
  return 1 - room * std::exp(-(value - kShoulder) / room);
}

// IEC 61966-2-1.
float srgb_encoded(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

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

// What libpng reads from; its error callback finds the name here.
struct PngSource {
  std::string_view left;
  const std::string& name;
};

[[noreturn]] void fail_reading(png_structp png, png_const_charp message) {
  const auto* source = static_cast<const PngSource*>(png_get_error_ptr(png));
  throw core::Error(core::Code::kDataLoss,
                    source->name + " cannot be read as PNG: " + message + "; save it again");
}

void ignore_warning(png_structp, png_const_charp) {}

void take(png_structp png, png_bytep data, png_size_t size) {
  auto* source = static_cast<PngSource*>(png_get_io_ptr(png));
  if (size > source->left.size()) {
    png_error(png, "it ends early");
  }
  std::copy_n(source->left.begin(), size, data);
  source->left.remove_prefix(size);
}

class PngReader {
 public:
  PngReader(std::string_view bytes, const std::string& name)
      : source_{bytes, name},
        png_(
            png_create_read_struct(PNG_LIBPNG_VER_STRING, &source_, fail_reading, ignore_warning)) {
    CHECK(png_ != nullptr);
    info_ = png_create_info_struct(png_);
    CHECK(info_ != nullptr);
    png_set_read_fn(png_, &source_, take);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
  PngReader(PngReader&&) = delete;
  PngReader& operator=(PngReader&&) = delete;
  [[nodiscard]] png_structp png() const { return png_; }
  [[nodiscard]] png_infop info() const { return info_; }

 private:
  PngSource source_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace

PlainPicture read_plain_png(std::string_view bytes, const std::string& name,
                            std::uint32_t side_limit) {
  PngReader reader(bytes, name);
  const png_structp png = reader.png();
  png_read_info(png, reader.info());
  PlainPicture picture;
  picture.width = png_get_image_width(png, reader.info());
  picture.height = png_get_image_height(png, reader.info());
  const png_byte type = png_get_color_type(png, reader.info());
  picture.has_palette = type == PNG_COLOR_TYPE_PALETTE;
  if ((type != PNG_COLOR_TYPE_PALETTE && type != PNG_COLOR_TYPE_GRAY &&
       type != PNG_COLOR_TYPE_GRAY_ALPHA) ||
      png_get_bit_depth(png, reader.info()) > 8) {
    throw core::Error(core::Code::kInvalidArgument,
                      name +
                          " has colours of its own or more than 8 bits; save it as a PNG with a "
                          "palette, or with 8-bit grey levels");
  }
  if (picture.width > side_limit || picture.height > side_limit) {
    throw core::Error(
        core::Code::kInvalidArgument,
        name + " is too large; give at most " + std::to_string(side_limit) + " pixels a side");
  }
  png_set_packing(png);
  png_set_strip_alpha(png);
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, reader.info());
  CHECK_EQ(png_get_rowbytes(png, reader.info()), std::size_t{picture.width});
  picture.values.resize(std::size_t{picture.width} * picture.height);
  for (int pass = 0; pass < passes; ++pass) {
    for (std::uint32_t y = 0; y < picture.height; ++y) {
      png_read_row(png, picture.values.data() + std::size_t{picture.width} * y, nullptr);
    }
  }
  return picture;
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

std::vector<std::uint8_t> tone_mapped(const Image& image, float exposure_stops) {
  const float scale = std::exp2(exposure_stops);
  std::vector<std::uint8_t> rgb;
  rgb.reserve(image.pixels.size() * 3);
  for (const glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) {
      const float value = pixel[c] * scale;
      const float shown = value > 0 ? srgb_encoded(rolled_off(value)) : 0;  // NaN is not above 0
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
