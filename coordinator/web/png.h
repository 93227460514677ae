#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace weft::coordinator {

// Stops that bring the mean over the lit pixels of their largest channel to a middle tone, as
// `weft render --png` chooses them; 0 for a black picture. `rgb` as below.
[[nodiscard]] float automatic_exposure(std::span<const float> rgb);

// The picture as a screen shows it: times 2^exposure_stops, values above 0.8 rolled off smoothly
// towards 1, as a PNG of 8-bit sRGB. `rgb` holds linear values, three a pixel, row by row from the
// top; NaN becomes black. REQUIRES: rgb.size() == 3 width height, neither of them 0. Throws
// core::Error(kInternal) when libpng refuses.
[[nodiscard]] std::string png_of(std::span<const float> rgb, std::uint32_t width,
                                 std::uint32_t height, float exposure_stops);

}  // namespace weft::coordinator
