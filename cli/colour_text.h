#pragma once

#include <string>

#include <glm/vec3.hpp>

namespace weft::cli {

// The linear colour (shading/colour_space.h) that people mean by
//   #7a1f2b, #a2c            sRGB, hexadecimal
//   linear:0.195,0.014,0.024 linear red, green, blue
//   lab:27.2,38.1,17.5       CIE L*, a*, b*, D65, 2 degree observer
// Throws core::Error(kInvalidArgument) when it is none of these, and when it lies outside of what
// red, green and blue between 0 and 1 can mix: it then names the nearest colour that does not.
[[nodiscard]] glm::dvec3 parse_colour(const std::string& text);

// "#7a1f2b": the nearest sRGB colour, channels cut at 0 and 1.
[[nodiscard]] std::string hex_text(glm::dvec3 linear);

}  // namespace weft::cli
