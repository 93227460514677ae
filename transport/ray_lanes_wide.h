#pragma once

// The words of ray_lanes_portable.h for one register of AVX-512. Every function carries WEFT_WIDE.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include <immintrin.h>

#include "transport/wide.h"

#define WEFT_KERNEL WEFT_WIDE inline
#define WEFT_LANES WEFT_WIDE [[gnu::always_inline]] inline

namespace weft::transport {
namespace {

struct Floats {
  __m512 v;
};

struct Mask {
  __mmask16 v;
};

inline constexpr __mmask16 kAllLanes = 0xffff;

WEFT_LANES Floats load(const float* p) { return {_mm512_load_ps(p)}; }
WEFT_LANES void store(float* p, Floats a) { _mm512_store_ps(p, a.v); }
WEFT_LANES Floats all(float a) { return {_mm512_set1_ps(a)}; }

WEFT_LANES Floats operator+(Floats a, Floats b) { return {_mm512_add_ps(a.v, b.v)}; }
WEFT_LANES Floats operator-(Floats a, Floats b) { return {_mm512_sub_ps(a.v, b.v)}; }
WEFT_LANES Floats operator*(Floats a, Floats b) { return {_mm512_mul_ps(a.v, b.v)}; }
WEFT_LANES Floats operator/(Floats a, Floats b) { return {_mm512_div_ps(a.v, b.v)}; }
WEFT_LANES Floats multiply_add(Floats a, Floats b, Floats c) {
  return {_mm512_fmadd_ps(a.v, b.v, c.v)};
}
WEFT_LANES Floats multiply_subtract(Floats a, Floats b, Floats c) {
  return {_mm512_fmsub_ps(a.v, b.v, c.v)};
}
WEFT_LANES Floats subtract_product(Floats c, Floats a, Floats b) {
  return {_mm512_fnmadd_ps(a.v, b.v, c.v)};
}
WEFT_LANES Floats square_root(Floats a) { return {_mm512_maskz_sqrt_ps(kAllLanes, a.v)}; }
WEFT_LANES Floats least(Floats a, Floats b) { return {_mm512_maskz_min_ps(kAllLanes, a.v, b.v)}; }
WEFT_LANES Floats greatest(Floats a, Floats b) {
  return {_mm512_maskz_max_ps(kAllLanes, a.v, b.v)};
}
WEFT_LANES Floats magnitude(Floats a) {
  return {_mm512_maskz_andnot_ps(kAllLanes, _mm512_set1_ps(-0.0f), a.v)};
}
WEFT_LANES Floats with_sign(Floats a, Floats b) {
  const __m512 sign = _mm512_set1_ps(-0.0f);
  return {_mm512_or_ps(_mm512_andnot_ps(sign, a.v), _mm512_and_ps(sign, b.v))};
}

WEFT_LANES Mask is_at_most(Floats a, Floats b) {
  return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LE_OQ)};
}
WEFT_LANES Mask is_less(Floats a, Floats b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)}; }
WEFT_LANES Mask operator&(Mask a, Mask b) { return {static_cast<__mmask16>(a.v & b.v)}; }
WEFT_LANES Mask operator|(Mask a, Mask b) { return {static_cast<__mmask16>(a.v | b.v)}; }
WEFT_LANES Mask without(Mask a, Mask b) { return {static_cast<__mmask16>(a.v & ~b.v)}; }
WEFT_LANES Floats choose(Mask mask, Floats yes, Floats no) {
  return {_mm512_mask_blend_ps(mask.v, no.v, yes.v)};
}
WEFT_LANES std::uint32_t bits(Mask mask) { return mask.v; }
WEFT_LANES std::uint32_t bits_of_equal(const std::uint32_t* p, std::uint32_t value) {
  return _mm512_cmpeq_epi32_mask(_mm512_load_si512(p), _mm512_set1_epi32(static_cast<int>(value)));
}

// Four words, the greatest first: a bitonic network (Batcher 1968).
WEFT_LANES __m256i greatest_first(__m256i words) {
  __m256i other = _mm256_permutex_epi64(words, 0b10'11'00'01);
  words = _mm256_mask_blend_epi64(0b1010, _mm256_max_epu64(words, other),
                                  _mm256_min_epu64(words, other));
  other = _mm256_permutex_epi64(words, 0b00'01'10'11);
  words = _mm256_mask_blend_epi64(0b1100, _mm256_max_epu64(words, other),
                                  _mm256_min_epu64(words, other));
  other = _mm256_permutex_epi64(words, 0b10'11'00'01);
  return _mm256_mask_blend_epi64(0b1010, _mm256_max_epu64(words, other),
                                 _mm256_min_epu64(words, other));
}

WEFT_LANES std::size_t push_nearest_last(std::uint64_t* stack, std::uint32_t lanes, Floats t,
                                         const std::uint32_t* child, std::uint32_t also) {
  const auto mask = static_cast<__mmask16>(lanes);
  const auto count = static_cast<std::size_t>(std::popcount(lanes));
  const __m512i distance = _mm512_maskz_compress_epi32(mask, _mm512_castps_si512(t.v));
  const __m512i named =
      _mm512_or_si512(_mm512_load_si512(child), _mm512_set1_epi32(static_cast<int>(also)));
  const __m512i children = _mm512_maskz_compress_epi32(mask, named);
  if (count <= 4) {
    // Places without a lane hold zero and come behind the others.
    const __m256i high = _mm256_cvtepu32_epi64(_mm512_maskz_extracti32x4_epi32(0xf, distance, 0));
    const __m256i low = _mm256_cvtepu32_epi64(_mm512_maskz_extracti32x4_epi32(0xf, children, 0));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(stack),
                        greatest_first(_mm256_or_si256(_mm256_slli_epi64(high, 32), low)));
    return count;
  }
  alignas(64) std::array<std::uint32_t, 16> distances;
  alignas(64) std::array<std::uint32_t, 16> names;
  _mm512_store_si512(distances.data(), distance);
  _mm512_store_si512(names.data(), children);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t waiting = std::uint64_t{distances[i]} << 32U | names[i];
    std::size_t at = i;
    for (; at > 0 && stack[at - 1] < waiting; --at) {
      stack[at] = stack[at - 1];
    }
    stack[at] = waiting;
  }
  return count;
}

}  // namespace
}  // namespace weft::transport
