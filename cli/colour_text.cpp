#include "cli/colour_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>
#include <glm/common.hpp>

#include "core/error.h"
#include "shading/colour_space.h"

namespace weft::cli {

namespace {

// Colours that were rounded for people may leave the gamut by so much.
constexpr double kRounding = 2e-4;

[[noreturn]] void refuse(const std::string& text, const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument, "'" + text + "' " + what);
}

constexpr const char* kForms =
    "is no colour; write #7a1f2b (sRGB), linear:0.195,0.014,0.024 (red, green, blue) or "
    "lab:27.2,38.1,17.5 (L*, a*, b* under D65)";

glm::dvec3 colour_of_hex(const std::string& text) {
  const std::string digits = text.substr(1);
  const bool is_short = digits.size() == 3;
  unsigned value = 0;
  const char* const end = digits.data() + digits.size();
  const auto parsed = std::from_chars(digits.data(), end, value, 16);
  if ((!is_short && digits.size() != 6) || parsed.ec != std::errc() || parsed.ptr != end) {
    refuse(text, kForms);
  }
  const unsigned bits = is_short ? 4 : 8;
  const unsigned most = (1U << bits) - 1;
  glm::dvec3 linear;
  for (int c = 0; c < 3; ++c) {
    const unsigned channel = value >> (bits * static_cast<unsigned>(2 - c)) & most;
    linear[c] = shading::linear_from_srgb(static_cast<double>(channel) / most);
  }
  return linear;
}

glm::dvec3 three_numbers(const std::string& text, std::size_t begin) {
  glm::dvec3 numbers;
  const char* at = text.data() + begin;
  const char* const end = text.data() + text.size();
  for (int c = 0; c < 3; ++c) {
    const auto parsed = std::from_chars(at, end, numbers[c]);
    const bool is_last = c == 2;
    if (parsed.ec != std::errc() || !std::isfinite(numbers[c]) ||
        (is_last ? parsed.ptr != end : parsed.ptr == end || *parsed.ptr != ',')) {
      refuse(text, kForms);
    }
    at = parsed.ptr + (is_last ? 0 : 1);
  }
  return numbers;
}

}  // namespace

glm::dvec3 parse_colour(const std::string& text) {
  if (text.starts_with('#')) {
    return colour_of_hex(text);
  }
  glm::dvec3 linear;
  if (text.starts_with("linear:")) {
    linear = three_numbers(text, 7);
  } else if (text.starts_with("lab:")) {
    const glm::dvec3 lab = three_numbers(text, 4);
    if (lab.x < 0 || lab.x > 100 || std::abs(lab.y) > 200 || std::abs(lab.z) > 200) {
      refuse(text, "is no colour: L* goes from 0 to 100, a* and b* from -200 to 200");
    }
    linear = shading::linear_from_lab(lab);
  } else {
    refuse(text, kForms);
  }
  const glm::dvec3 inside = glm::clamp(linear, 0.0, 1.0);
  for (int c = 0; c < 3; ++c) {
    if (std::abs(linear[c] - inside[c]) > kRounding) {
      refuse(text, fmt::format("is outside of what fibres can reflect: its linear red, green and "
                               "blue are {:.4g}, {:.4g}, {:.4g}, and each must be from 0 to 1; {} "
                               "is near it and inside",
                               linear.x, linear.y, linear.z, hex_text(inside)));
    }
  }
  return inside;
}

std::string hex_text(glm::dvec3 linear) {
  std::array<int, 3> channels{};
  for (int c = 0; c < 3; ++c) {
    const double encoded = shading::srgb_from_linear(std::clamp(linear[c], 0.0, 1.0));
    channels[static_cast<std::size_t>(c)] = static_cast<int>(std::lround(255 * encoded));
  }
  return fmt::format("#{:02x}{:02x}{:02x}", channels[0], channels[1], channels[2]);
}

}  // namespace weft::cli
