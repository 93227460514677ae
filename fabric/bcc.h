#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// One curve of a binary curve collection, in the file's unit, z up.
struct BccCurve {
  std::vector<glm::dvec3> points;
  bool closed = false;  // it goes on from the last point to the first
};

// Reads Yuksel's binary curve collection (BCC, cemyuksel.com/cyCodeBase/soln/using_bcc_files.html):
// a header of 64 bytes, then for each curve its number of points, negative where the curve is
// closed, and their coordinates; integers and floats of four bytes, three dimensions. Curves that
// are up along y are turned. Throws core::Error(kInvalidArgument), "name: byte N: what is wrong",
// when the file is none, is cut short, has more than kMostBccPoints or a number that is not finite.
[[nodiscard]] std::vector<BccCurve> read_bcc(std::string_view bytes, const std::string& name);

inline constexpr std::uint64_t kMostBccBytes = std::uint64_t{64} << 20;
inline constexpr std::uint64_t kMostBccPoints = std::uint64_t{1} << 20;

// How curves become cloth: a collection does not say where it repeats.
struct CurveTiling {
  glm::dvec2 period_mm{0};  // both positive
  double mm_per_unit = 1;   // of the file
  double radius_mm = 0.1;   // of the yarns or fibres; positive
};

// A curve whose end is its start moved by whole periods goes on there.
struct PeriodicCurve {
  BccCurve curve;  // millimetres; without the last point when it is periodic
  glm::ivec2 period{0, 0};
  bool is_periodic = false;  // or closed
};

// The curves in millimetres, and which of them go on. The two ends count as the same point of the
// cloth within half a radius.
[[nodiscard]] std::vector<PeriodicCurve> periodic_curves(const std::vector<BccCurve>& curves,
                                                         const CurveTiling& tiling);

// Centre lines of yarns as a periodic yarn pattern (knit_pattern.h) in millimetres. Throws
// core::Error(kInvalidArgument) naming the first curve that ends: cloth has no such yarns.
[[nodiscard]] std::string pattern_text(const std::vector<BccCurve>& curves,
                                       const CurveTiling& tiling, const std::string& name);

// The curves as fibres of one material; those that do not go on have open ends.
[[nodiscard]] v1::ExplicitFibres explicit_fibres(const std::vector<BccCurve>& curves,
                                                 const CurveTiling& tiling,
                                                 const std::string& material);

}  // namespace weft::fabric
