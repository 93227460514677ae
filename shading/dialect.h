// The dialect that C++20 and GLSL share. Headers marked "shared text" hold pure functions and
// structs that both languages read alike; this file is the only one that tells them apart.
#ifndef WEFT_SHADING_DIALECT_H
#define WEFT_SHADING_DIALECT_H

#ifdef __cplusplus

#include <cstdint>

#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#define SHARED [[nodiscard]] inline
#define SHARED_BEGIN namespace weft::shading {
#define SHARED_END }

namespace weft::shading {

using glm::mat3;
using glm::vec2;
using glm::vec3;
using glm::vec4;
using uint = std::uint32_t;

using glm::abs;
using glm::acos;
using glm::asin;
using glm::atan;
using glm::clamp;
using glm::cos;
using glm::cross;
using glm::dot;
using glm::exp;
using glm::floor;
using glm::fract;
using glm::inversesqrt;
using glm::length;
using glm::log;
using glm::max;
using glm::min;
using glm::mix;
using glm::normalize;
using glm::sin;
using glm::sqrt;

// Tables are reached by accessors that the including program defines; here they are pointers.
using LobeTable = const glm::vec2*;
[[nodiscard]] inline glm::vec2 lobe_table_entry(LobeTable table, int index) { return table[index]; }

}  // namespace weft::shading

#else

#define SHARED
#define SHARED_BEGIN
#define SHARED_END
// A kernel defines `vec2 lobe_table_entry(LobeTable table, int index)` over its own buffer, where
// `table` is the index of the material's first entry.
#define LobeTable int

#endif

SHARED_BEGIN

const float kPi = 3.14159265358979f;
const float kHalfPi = 1.57079632679490f;
const float kTwoPi = 6.28318530717959f;
const float kFourPi = 12.5663706143592f;

SHARED_END

#endif
