// The dialect that C++20 and GLSL share. Headers marked "shared text" hold pure functions and
// structs that both languages read alike; this file is the only one that tells them apart.
#ifndef WEFT_SHADING_DIALECT_H
#define WEFT_SHADING_DIALECT_H

#ifdef __cplusplus

#include <cstdint>

#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/ext/vector_int2.hpp>
#include <glm/ext/vector_int3.hpp>
#include <glm/ext/vector_int4.hpp>
#include <glm/ext/vector_uint2.hpp>
#include <glm/ext/vector_uint3.hpp>
#include <glm/ext/vector_uint4.hpp>
#include <glm/geometric.hpp>
#include <glm/integer.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/packing.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#define SHARED [[nodiscard]] inline
#define SHARED_BEGIN namespace weft::shading {
#define SHARED_END }

namespace weft::shading {

using glm::ivec2;
using glm::ivec3;
using glm::ivec4;
using glm::mat3;
using glm::mat4;
using glm::uvec2;
using glm::uvec3;
using glm::uvec4;
using glm::vec2;
using glm::vec3;
using glm::vec4;
using uint = std::uint32_t;

using glm::abs;
using glm::acos;
using glm::asin;
using glm::atan;
using glm::bitCount;
using glm::ceil;
using glm::clamp;
using glm::cos;
using glm::cross;
using glm::determinant;
using glm::distance;
using glm::dot;
using glm::exp;
using glm::exp2;
using glm::findLSB;
using glm::findMSB;
using glm::floatBitsToInt;
using glm::floatBitsToUint;
using glm::floor;
using glm::fract;
using glm::intBitsToFloat;
using glm::inverse;
using glm::inversesqrt;
using glm::isinf;
using glm::isnan;
using glm::length;
using glm::log;
using glm::log2;
using glm::max;
using glm::min;
using glm::mix;
using glm::mod;
using glm::normalize;
using glm::packHalf2x16;
using glm::packUnorm2x16;
using glm::pow;
using glm::reflect;
using glm::round;
using glm::sign;
using glm::sin;
using glm::smoothstep;
using glm::sqrt;
using glm::step;
using glm::tan;
using glm::transpose;
using glm::trunc;
using glm::uintBitsToFloat;
using glm::unpackHalf2x16;
using glm::unpackUnorm2x16;

// Tables are reached by accessors that the including program defines; here they are pointers.
using LobeTable = const glm::vec2*;
[[nodiscard]] inline glm::vec2 lobe_table_entry(LobeTable table, int index) { return table[index]; }

}  // namespace weft::shading

#else

#define SHARED
#define SHARED_BEGIN
#define SHARED_END
// `table` is the index of the material's first entry. A kernel that evaluates the BCSDF defines the
// accessor over its own buffer.
#define LobeTable int
vec2 lobe_table_entry(LobeTable table, int index);

#endif

SHARED_BEGIN

const float kPi = 3.14159265358979f;
const float kHalfPi = 1.57079632679490f;
const float kTwoPi = 6.28318530717959f;
const float kFourPi = 12.5663706143592f;

SHARED_END

#endif
