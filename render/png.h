#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "render/image.h"

namespace weft::render {

// Writes 8-bit sRGB pixels, row-major, top row first, three bytes each, as PNG. Written beside and
// renamed. REQUIRES: rgb.size() == 3 width height, neither of them 0. Throws
// core::Error(kUnavailable) when the file cannot be written.
void write_png(const std::filesystem::path& path, std::uint32_t width, std::uint32_t height,
               std::span<const std::uint8_t> rgb);

// The picture as a screen shows it: times 2^exposure_stops, values above 0.8 rolled off smoothly
// towards 1, encoded as sRGB. NaN becomes black.
[[nodiscard]] std::vector<std::uint8_t> tone_mapped(const Image& image, float exposure_stops = 0);

// Stops that bring the mean over the lit pixels of their largest channel to a middle tone (0.25);
// 0 for a black picture.
[[nodiscard]] float automatic_exposure(const Image& image);

}  // namespace weft::render
