#pragma once

#include <glm/vec3.hpp>

// Colours as people name them, and how far apart two of them look. Linear colours have the
// primaries and the white (D65) of sRGB (IEC 61966-2-1); a perfect white diffuser is (1, 1, 1).

namespace weft::shading {

// The transfer curve of sRGB, for one channel, and back. Any real number; negative ones mirrored.
[[nodiscard]] double srgb_from_linear(double linear);
[[nodiscard]] double linear_from_srgb(double encoded);

// CIE 1976 L*, a*, b* of a linear colour, 2 degree observer, white point D65.
[[nodiscard]] glm::dvec3 lab_from_linear(glm::dvec3 linear);
// Outside the gamut of sRGB a channel comes out below 0 or above 1.
[[nodiscard]] glm::dvec3 linear_from_lab(glm::dvec3 lab);

// CIEDE2000 with k_L = k_C = k_H = 1 between two colours in L*, a*, b* (Sharma, Wu, Dalal 2005,
// "The CIEDE2000 color-difference formula: implementation notes, supplementary test data, and
// mathematical observations"). Symmetric.
[[nodiscard]] double delta_e_2000(glm::dvec3 lab_1, glm::dvec3 lab_2);

}  // namespace weft::shading
