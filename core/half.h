#pragma once

#include <cstdint>

#include <immintrin.h>

namespace weft::core {

// IEEE 754 binary16 as raw bits, from and to float, by the processor's own conversion (F16C, a part
// of x86-64-v3). Rounds to nearest, ties to even; what exceeds 65504 becomes infinity, and what is
// no number the one quiet one of its sign.
[[nodiscard]] inline std::uint16_t half_from_float(float value) {
  if (value != value) {
    return static_cast<std::uint16_t>(0x7e00U | (__builtin_signbit(value) != 0 ? 0x8000U : 0U));
  }
  return _cvtss_sh(value, _MM_FROUND_TO_NEAREST_INT);
}

[[nodiscard]] inline float float_from_half(std::uint16_t half) { return _cvtsh_ss(half); }

}  // namespace weft::core
