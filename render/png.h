#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>

#include "render/image.h"

namespace weft::render {

// Writes 8-bit sRGB pixels, row-major, top row first, three bytes each, as PNG. Written beside and
// renamed. REQUIRES: rgb.size() == 3 width height, neither of them 0. Throws
// core::Error(kUnavailable) when the file cannot be written.
void write_png(const std::filesystem::path& path, std::uint32_t width, std::uint32_t height,
               std::span<const std::uint8_t> rgb);

// A picture that measures a surface: each value is a share of the greatest.
struct MapPicture {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t channels = 3;  // 3, or 4 with an alpha
  std::uint32_t bits = 8;      // 8 or 16 are kept of each value
  bool is_colour = false;      // sRGB (the alpha is linear); else numbers, to be left as they are
  std::vector<float> values;   // [height, width, channels] in [0, 1], top row first
};

// Writes it as PNG, with its physical size (chunk pHYs) and texts. Values are clamped to [0, 1];
// NaN becomes 0. Written beside and renamed; the bytes depend on nothing but the arguments.
// REQUIRES: as many values as the sides say, and a positive size. Throws
// core::Error(kUnavailable) when the file cannot be written.
void write_map_png(const std::filesystem::path& path, const MapPicture& picture, glm::vec2 size_mm,
                   const std::map<std::string, std::string>& texts);

// A linear value as sRGB has it (IEC 61966-2-1).
[[nodiscard]] float srgb_encoded(float linear);

// A picture of numbers: of the colours in a palette, or grey levels as they are stored.
struct PlainPicture {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  bool has_palette = false;
  std::vector<std::uint8_t> values;  // [height, width], top row first
};

// Decodes a PNG with a palette, or a grey one of at most 8 bits, in the sandbox (core/sandbox.h).
// Throws core::Error: kDataLoss when it is damaged or no PNG, kInvalidArgument when it has colours
// without a palette, more bits, or a side beyond `side_limit`, kResourceExhausted above 64 MiB;
// `name` stands for it in messages.
[[nodiscard]] PlainPicture read_plain_png(std::string_view bytes, const std::string& name,
                                          std::uint32_t side_limit);

// The picture as a screen shows it: times 2^exposure_stops, values above 0.8 rolled off smoothly
// towards 1, encoded as sRGB. NaN becomes black.
[[nodiscard]] std::vector<std::uint8_t> tone_mapped(const Image& image, float exposure_stops = 0);

// Stops that bring the mean over the lit pixels of their largest channel to a middle tone (0.25);
// 0 for a black picture.
[[nodiscard]] float automatic_exposure(const Image& image);

}  // namespace weft::render
