#include "transport/transfer.h"

#include <algorithm>
#include <numbers>

#include "core/check.h"
#include "core/random.h"
#include "transport/path.h"
#include "transport/sh_chunk.h"
#include "transport/sphere.h"

namespace weft::transport {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// What one path estimates: `weight` times Y_j0(light) Y_j1(arrival).
struct Estimate {
  glm::vec3 weight{0, 0, 0};
  glm::vec3 light{0, 0, 1};
};

// E[4 pi tau Y(exit) Y(omega_1)], omega_1 uniform over the sphere and exit the direction in which
// the path leaves after n >= 1 scatterings: that it leaves is the light's visibility.
Estimate exit_estimate(Path& path, const TransferSettings& settings, core::Random& random) {
  while (path.advance()) {
    if (path.vertices() > settings.max_path_length || !path.scatter(random)) {
      return {};
    }
  }
  const bool counts = (path.vertices() > 0 || settings.with_direct) &&
                      (settings.lights_below || path.direction().z > 0);
  return counts ? Estimate{4 * kPi * path.throughput(), path.direction()} : Estimate{};
}

// (2 pi)(4 pi) sum over vertices of tau S(omega_0, -omega_n) cos(theta_0) V(omega_0).
Estimate light_estimate(Path& path, const TransferSettings& settings, core::Random& random) {
  const float u_z = random.uniform();
  Estimate estimate;
  estimate.light = uniform_direction(settings.lights_below ? u_z : 0.5f * u_z, random.uniform());
  const float density = settings.lights_below ? 1 / (4 * kPi) : 1 / (2 * kPi);
  while (path.advance() && path.vertices() <= settings.max_path_length) {
    estimate.weight += path.throughput() * path.reflected(estimate.light);
    if (!path.scatter(random)) {
      break;
    }
  }
  estimate.weight *= 4 * kPi / density;
  return estimate;
}

}  // namespace

TransferSums transfer_sums(const Scene& scene, std::span<const shading::FibreBcsdf> materials,
                           const CellPaths& paths, const TransferSettings& settings,
                           const Checkpoint& checkpoint) {
  CHECK(!settings.with_direct || settings.estimator == Estimator::kExit);
  CHECK(paths.segments != nullptr && !paths.segments->segments.empty());
  CHECK_EQ(materials.size(), scene.tile().material_names.size());
  ShChunk chunk(settings.sh_order);
  TransferSums sums;
  sums.paths = paths.count;
  sums.sum.assign(chunk.size(), 0);
  sums.sum_of_squares.assign(chunk.size(), 0);
  for (std::uint64_t i = paths.first; i < paths.first + paths.count; ++i) {
    core::Random random(settings.seed, paths.cell, i);
    const std::uint32_t segment = paths.segments->draw(random);
    const float u_z = random.uniform();
    const glm::vec3 arrival = uniform_direction(u_z, random.uniform());
    Path path(scene, materials, segment, arrival);
    const Estimate estimate = settings.estimator == Estimator::kExit
                                  ? exit_estimate(path, settings, random)
                                  : light_estimate(path, settings, random);
    chunk.add(estimate.weight, arrival, estimate.light);
    if ((i + 1) % kTransferChunkPaths == 0 || i + 1 == paths.first + paths.count) {
      chunk.flush(sums.sum, sums.sum_of_squares);
      pass(checkpoint);
    }
  }
  return sums;
}

}  // namespace weft::transport
