#pragma once

// Sixteen floats as two registers of AVX2, which every build of ours may use. What this file names,
// ray_lanes_wide.h names too; ray_kernel_text.h is written in these words. Each operation rounds
// once, as IEEE 754 says, so that both give the same bits.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include <immintrin.h>

#define WEFT_KERNEL inline

namespace weft::transport {
namespace {

struct Floats {
  __m256 low;
  __m256 high;
};

struct Mask {
  __m256 low;
  __m256 high;
};

inline Floats load(const float* p) { return {_mm256_load_ps(p), _mm256_load_ps(p + 8)}; }
inline void store(float* p, Floats a) {
  _mm256_store_ps(p, a.low);
  _mm256_store_ps(p + 8, a.high);
}
inline Floats all(float a) { return {_mm256_set1_ps(a), _mm256_set1_ps(a)}; }

inline Floats operator+(Floats a, Floats b) {
  return {_mm256_add_ps(a.low, b.low), _mm256_add_ps(a.high, b.high)};
}
inline Floats operator-(Floats a, Floats b) {
  return {_mm256_sub_ps(a.low, b.low), _mm256_sub_ps(a.high, b.high)};
}
inline Floats operator*(Floats a, Floats b) {
  return {_mm256_mul_ps(a.low, b.low), _mm256_mul_ps(a.high, b.high)};
}
inline Floats operator/(Floats a, Floats b) {
  return {_mm256_div_ps(a.low, b.low), _mm256_div_ps(a.high, b.high)};
}
// a b + c, a b - c and c - a b, rounded once.
inline Floats multiply_add(Floats a, Floats b, Floats c) {
  return {_mm256_fmadd_ps(a.low, b.low, c.low), _mm256_fmadd_ps(a.high, b.high, c.high)};
}
inline Floats multiply_subtract(Floats a, Floats b, Floats c) {
  return {_mm256_fmsub_ps(a.low, b.low, c.low), _mm256_fmsub_ps(a.high, b.high, c.high)};
}
inline Floats subtract_product(Floats c, Floats a, Floats b) {
  return {_mm256_fnmadd_ps(a.low, b.low, c.low), _mm256_fnmadd_ps(a.high, b.high, c.high)};
}
inline Floats square_root(Floats a) { return {_mm256_sqrt_ps(a.low), _mm256_sqrt_ps(a.high)}; }
// The second where the two are equal or one is NaN.
inline Floats least(Floats a, Floats b) {
  return {_mm256_min_ps(a.low, b.low), _mm256_min_ps(a.high, b.high)};
}
inline Floats greatest(Floats a, Floats b) {
  return {_mm256_max_ps(a.low, b.low), _mm256_max_ps(a.high, b.high)};
}
inline Floats magnitude(Floats a) {
  const __m256 sign = _mm256_set1_ps(-0.0f);
  return {_mm256_andnot_ps(sign, a.low), _mm256_andnot_ps(sign, a.high)};
}
// |a| with the sign of b.
inline Floats with_sign(Floats a, Floats b) {
  const __m256 sign = _mm256_set1_ps(-0.0f);
  return {_mm256_or_ps(_mm256_andnot_ps(sign, a.low), _mm256_and_ps(sign, b.low)),
          _mm256_or_ps(_mm256_andnot_ps(sign, a.high), _mm256_and_ps(sign, b.high))};
}

// Comparisons are false where a number is NaN.
inline Mask is_at_most(Floats a, Floats b) {
  return {_mm256_cmp_ps(a.low, b.low, _CMP_LE_OQ), _mm256_cmp_ps(a.high, b.high, _CMP_LE_OQ)};
}
inline Mask is_less(Floats a, Floats b) {
  return {_mm256_cmp_ps(a.low, b.low, _CMP_LT_OQ), _mm256_cmp_ps(a.high, b.high, _CMP_LT_OQ)};
}
inline Mask operator&(Mask a, Mask b) {
  return {_mm256_and_ps(a.low, b.low), _mm256_and_ps(a.high, b.high)};
}
inline Mask operator|(Mask a, Mask b) {
  return {_mm256_or_ps(a.low, b.low), _mm256_or_ps(a.high, b.high)};
}
// a without b.
inline Mask without(Mask a, Mask b) {
  return {_mm256_andnot_ps(b.low, a.low), _mm256_andnot_ps(b.high, a.high)};
}
inline Floats choose(Mask mask, Floats yes, Floats no) {
  return {_mm256_blendv_ps(no.low, yes.low, mask.low),
          _mm256_blendv_ps(no.high, yes.high, mask.high)};
}
// Bit i for lane i.
inline std::uint32_t bits(Mask mask) {
  return static_cast<std::uint32_t>(_mm256_movemask_ps(mask.low)) |
         static_cast<std::uint32_t>(_mm256_movemask_ps(mask.high)) << 8U;
}
inline std::uint32_t bits_of_equal(const std::uint32_t* p, std::uint32_t value) {
  const __m256i wanted = _mm256_set1_epi32(static_cast<int>(value));
  const auto* from = reinterpret_cast<const __m256i*>(p);
  return bits({_mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_load_si256(from), wanted)),
               _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_load_si256(from + 1), wanted))});
}

// Writes (bits of t << 32 | child | also) of each lane in `lanes`, the least last; t must not be
// negative. Returns how many. Up to four words behind them may be written over.
inline std::size_t push_nearest_last(std::uint64_t* stack, std::uint32_t lanes, Floats t,
                                     const std::uint32_t* child, std::uint32_t also) {
  alignas(64) std::array<float, 16> distance;
  store(distance.data(), t);
  std::size_t count = 0;
  for (; lanes != 0; lanes &= lanes - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(lanes));
    const std::uint64_t waiting =
        std::uint64_t{std::bit_cast<std::uint32_t>(distance[lane])} << 32U | (child[lane] | also);
    std::size_t at = count++;
    for (; at > 0 && stack[at - 1] < waiting; --at) {
      stack[at] = stack[at - 1];
    }
    stack[at] = waiting;
  }
  return count;
}

}  // namespace
}  // namespace weft::transport
