#pragma once

#include <cmath>

namespace weft::shading {

// How pictures for screens show what is brighter than a screen: values up to 0.8 are kept as they
// are, those above roll off smoothly towards 1. Linear values.
[[nodiscard]] inline float rolled_off(float value) {
  constexpr float kShoulder = 0.8F;
  if (value <= kShoulder) {
    return value;
  }
  constexpr float kRoom = 1 - kShoulder;
  return 1 - kRoom * std::exp(-(value - kShoulder) / kRoom);
}

}  // namespace weft::shading
