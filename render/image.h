#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <glm/vec3.hpp>

namespace weft::render {

// A channel of a picture besides its colour, such as "single.R".
struct ImageChannel {
  std::string name;
  // [height, width]; whole numbers are written as 32-bit UINT.
  std::variant<std::vector<float>, std::vector<std::uint32_t>> values;
  bool always_float = false;  // 32 bits even where the picture has 16: too small for halves
};

// A picture in linear RGB (scene-referred radiance), row-major, top row first.
struct Image {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<glm::vec3> pixels;                  // [height, width]
  std::vector<ImageChannel> channels;             // more than colour; read_exr leaves them out
  std::map<std::string, std::string> attributes;  // how it was made; written into the file's header

  Image() = default;
  Image(std::uint32_t image_width, std::uint32_t image_height)
      : width(image_width),
        height(image_height),
        pixels(static_cast<std::size_t>(image_width) * image_height, glm::vec3(0)) {}

  [[nodiscard]] glm::vec3& at(std::uint32_t x, std::uint32_t y) {
    return pixels[static_cast<std::size_t>(y) * width + x];
  }
  [[nodiscard]] const glm::vec3& at(std::uint32_t x, std::uint32_t y) const {
    return pixels[static_cast<std::size_t>(y) * width + x];
  }
};

// No picture that is read or asked for may have more pixels a side than this.
inline constexpr std::uint32_t kImageSideLimit = 16384;

enum class ExrPixels { kHalf, kFloat };

// Writes `image` as an OpenEXR file with channels R, G, B, those of image.channels, and one string
// attribute per entry of image.attributes. Written beside and renamed. The bytes depend on nothing
// but the arguments. Values beyond the largest half are clamped to it when `pixels` is kHalf.
// Throws core::Error(kUnavailable) when the file cannot be written.
void write_exr(const std::filesystem::path& path, const Image& image,
               ExrPixels pixels = ExrPixels::kHalf);

// Reads the channels R, G, B (or X, Y, Z, or Y alone, as grey) of a layer - none: the picture's
// own - and all string attributes. OpenEXR sees the file in the sandbox alone (core/sandbox.h).
// Throws core::Error(kNotFound) when there is no such file, kDataLoss when it is damaged,
// kInvalidArgument when it has no such channels or a side exceeds kImageSideLimit, and
// kResourceExhausted when it or its pixels exceed the limits of render/files/exr_parser.h.
[[nodiscard]] Image read_exr(const std::filesystem::path& path, std::string_view layer = "");

// The same from memory; `name` stands for the file in messages.
[[nodiscard]] Image read_exr_bytes(std::string_view bytes, const std::string& name,
                                   std::string_view layer = "");

}  // namespace weft::render
