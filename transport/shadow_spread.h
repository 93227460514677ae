#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "shading/fibre_bcsdf.h"
#include "transport/checkpoint.h"
#include "transport/scene.h"

namespace weft::transport {

struct SpreadSettings {
  std::uint64_t seed = 0;
  std::uint32_t max_path_length = 10000;  // scatterings after the first; longer paths count nothing
  double bin_mm = 0;
  std::uint32_t bins = 0;
};

inline constexpr std::uint64_t kSpreadChunkPaths = 256;
inline constexpr double kSpreadLargestWeight = 64;

// How far from where it is seen the light of multiple scattering entered the cloth: sums, in fixed
// point (core/moments.h), of the light of paths from the eye, by |x| and by |y| of the way from
// below the point of the upper surface where a path leaves the cloth to where it began; [bins + 1],
// the last for what lies beyond. Divided by their total they are the shadow of multiple scattering
// across the edge of a half-plane (Khungurn et al. 2017, section 5.3.2): at distance d from it,
// within the light, arrives all that entered at less than d on the other side.
//
// Eyes look at endless cloth from the upper hemisphere by cosine, onto every place alike, and light
// of one radiance comes from the whole upper hemisphere: one spread for all directions. Light
// counts by the mean of its channels; a path by at most kSpreadLargestWeight. Paths are numbered:
// the sums of [0, n) are those of [0, m) plus [m, n) to the bit.
struct SpreadSums {
  std::uint64_t paths = 0;
  std::vector<std::int64_t> sum;
};
[[nodiscard]] SpreadSums spread_sums(const Scene& scene,
                                     std::span<const shading::FibreBcsdf> materials,
                                     std::uint64_t first, std::uint64_t count,
                                     const SpreadSettings& settings,
                                     const Checkpoint& checkpoint = {});

}  // namespace weft::transport
