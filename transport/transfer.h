#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "shading/fibre_bcsdf.h"
#include "transport/checkpoint.h"
#include "transport/scene.h"
#include "transport/seen_segments.h"

namespace weft::transport {

// How the transfer matrix of a cell is estimated. Both have the same expectation: the operator of
// T( omega_0, omega_1, x), radiance arriving at x from omega_1 per unit of distant light from
// omega_0 after at least one scattering (Khungurn et al. 2017, section 4.2).
enum class Estimator {
  // The path's own exit is its light: 4 pi tau Y_j0(exit) Y_j1(omega_1). The light is drawn from
  // the density that the cloth transports, and there are no shadow rays. Paths split where they
  // have grown heavy or come near the light, and end where they are light or far from it; a path's
  // estimate is the sum over its exits. Segment, omega_1 and the first scattering are points of a
  // scrambled Sobol sequence, whose number is the path's.
  kExit,
  // The paper's: one light per path, uniform over the upper hemisphere, connected to every vertex.
  kLight,
};

struct TransferSettings {
  std::uint32_t sh_order = 5;
  Estimator estimator = Estimator::kExit;
  std::uint64_t seed = 0;
  std::uint32_t max_path_length = 10000;  // scatterings; longer paths count for nothing
  bool lights_below = false;  // else light comes from the upper hemisphere only, as in the paper
  // Light that arrives without any scattering counts too: standard PRT (Sloan et al. 2002). The
  // exit estimator alone has it.
  bool with_direct = false;
};

// Which paths of which cell.
struct CellPaths {
  std::uint32_t cell = 0;
  const CellSegments* segments = nullptr;  // whose midpoints lie in the cell; not empty
  std::uint64_t first = 0;
  std::uint64_t count = 0;
};

inline constexpr std::uint64_t kTransferChunkPaths = 256;

// Sums over paths of the estimates of a[j1, j0] and of their squares, in fixed point
// (core/moments.h), [3, (order+1)^2 (j1, incoming), (order+1)^2 (j0, light)]. Chunks of 256 paths,
// aligned to the path's number, are summed in float in order and then added in fixed point: the
// sums of [0, n) are those of [0, m) plus [m, n) to the bit for every multiple m of 256. A chunk's
// sum of squares saturates at 2^25, which takes a path whose estimate exceeds 5000. Standard errors
// that follow from the squares take paths for independent: the exit estimator's points are spread
// more evenly than that, so that its mean is as close to the truth as they say, or closer.
struct TransferSums {
  std::uint64_t paths = 0;
  std::vector<std::int64_t> sum;
  std::vector<std::int64_t> sum_of_squares;
  // Light by orders of scattering (transport/order_chunk.h); empty by the paper's estimator, and of
  // cloth of more materials than are counted.
  std::vector<std::int64_t> order_numbers;
  std::vector<std::int64_t> order_shapes;
};

// Adds sums over further paths of the same cell, by the same settings.
void add_sums(const TransferSums& more, TransferSums& sums);

[[nodiscard]] TransferSums transfer_sums(const Scene& scene,
                                         std::span<const shading::FibreBcsdf> materials,
                                         const CellPaths& paths, const TransferSettings& settings,
                                         const Checkpoint& checkpoint = {});

}  // namespace weft::transport
