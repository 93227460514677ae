#include "transport/transfer.h"

#include <algorithm>
#include <functional>
#include <numbers>
#include <optional>
#include <vector>

#include "core/check.h"
#include "core/random.h"
#include "core/sobol.h"
#include "transport/order_chunk.h"
#include "transport/path.h"
#include "transport/sh_chunk.h"
#include "transport/sphere.h"

namespace weft::transport {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// How many times as much a path at the top of the cloth is worth as one at its bottom, but one:
// light comes from above. Measured: 0 takes 2 to 10 % more time for the same variance, and 1 to 3
// make no difference.
constexpr float kWorthOfHeight = 2;

// What is kept from path to path, for the sake of its memory.
struct Workspace {
  std::vector<Path> pending;        // parts of the path that have yet to be followed
  std::vector<LightSample> lights;  // that it found
  bool wants_orders = false;
  std::vector<OrderedLight> ordered;  // the same, but for light that came directly
};

// Worth of a path at a height over that of its start.
class Worth {
 public:
  Worth(const fabric::Tile& tile, const TransferSettings& settings, double start_mm)
      : bottom_mm_(tile.z_min_mm),
        slope_(settings.lights_below || !(tile.z_max_mm > tile.z_min_mm)
                   ? 0
                   : kWorthOfHeight / (tile.z_max_mm - tile.z_min_mm)),
        of_start_(absolute(start_mm)) {}
  [[nodiscard]] float at(double height_mm) const { return absolute(height_mm) / of_start_; }

 private:
  // Surfaces bulge out of the slab by a radius, which is no reason for a worth below 1.
  [[nodiscard]] float absolute(double height_mm) const {
    return 1 + slope_ * std::max(0.0f, static_cast<float>(height_mm) - bottom_mm_);
  }

  float bottom_mm_;
  float slope_;
  float of_start_;
};

glm::vec3 three_numbers(core::Random& random) {
  const float a = random.uniform();
  const float b = random.uniform();
  return {a, b, random.uniform()};
}

// E[4 pi tau Y(exit) Y(omega_1)], omega_1 uniform over the sphere and exit the direction in which
// the path leaves after n >= 1 scatterings: that it leaves is the light's visibility. `first`
// serves the first scattering.
void find_exits(const Path& start, glm::vec3 first, const TransferSettings& settings,
                const Worth& worth, core::Random& random, Workspace& work) {
  work.pending.clear();
  work.pending.push_back(start);
  while (!work.pending.empty()) {
    Path path = work.pending.back();
    work.pending.pop_back();
    bool alive = true;
    while (alive && path.advance()) {
      const glm::vec3 u = path.vertices() == 1 ? first : three_numbers(random);
      alive = path.vertices() <= settings.max_path_length &&
              path.scatter(u, worth.at(path.height_mm()), random, work.pending);
    }
    if (alive && (path.vertices() > 0 || settings.with_direct) &&
        (settings.lights_below || path.direction().z > 0)) {
      work.lights.push_back({4 * kPi * path.throughput(), path.direction()});
      if (work.wants_orders && path.vertices() > 0) {
        work.ordered.push_back({work.lights.back(), path.counts(), path.vertices()});
      }
    }
  }
}

// (2 pi)(4 pi) sum over vertices of tau S(omega_0, -omega_n) cos(theta_0) V(omega_0).
void connect_light(Path path, const TransferSettings& settings, core::Random& random,
                   Workspace& work) {
  const float u_z = random.uniform();
  LightSample light;
  light.direction = uniform_direction(settings.lights_below ? u_z : 0.5f * u_z, random.uniform());
  const float density = settings.lights_below ? 1 / (4 * kPi) : 1 / (2 * kPi);
  while (path.advance() && path.vertices() <= settings.max_path_length) {
    light.weight += path.throughput() * path.reflected(light.direction);
    if (!path.scatter(random)) {
      break;
    }
  }
  light.weight *= 4 * kPi / density;
  if (light.weight != glm::vec3(0, 0, 0)) {
    work.lights.push_back(light);
  }
}

// Light by orders, where it is counted.
std::optional<OrderChunk> order_chunk(const TransferSettings& settings, std::size_t materials) {
  const bool is_counted =
      settings.estimator == Estimator::kExit && materials <= shading::kMostCountedMaterials;
  return is_counted ? std::optional<OrderChunk>(std::in_place, settings.sh_order, materials)
                    : std::nullopt;
}

// In [0, 1), 24 bits, as core::Random::uniform().
float unit(std::uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

}  // namespace

TransferSums transfer_sums(const Scene& scene, std::span<const shading::FibreBcsdf> materials,
                           const CellPaths& paths, const TransferSettings& settings,
                           const Checkpoint& checkpoint) {
  CHECK(!settings.with_direct || settings.estimator == Estimator::kExit);
  CHECK(paths.segments != nullptr && !paths.segments->segments.empty());
  CHECK_EQ(materials.size(), scene.tile().material_names.size());
  ShChunk chunk(settings.sh_order);
  Workspace work;
  const core::SobolPoints points(settings.seed, paths.cell);
  TransferSums sums;
  sums.paths = paths.count;
  sums.sum.assign(chunk.size(), 0);
  sums.sum_of_squares.assign(chunk.size(), 0);
  std::optional<OrderChunk> orders = order_chunk(settings, materials.size());
  work.wants_orders = orders.has_value();
  if (orders) {
    sums.order_numbers.assign(orders->numbers(), 0);
    sums.order_shapes.assign(orders->shape_entries(), 0);
  }
  for (std::uint64_t i = paths.first; i < paths.first + paths.count; ++i) {
    core::Random random(settings.seed, paths.cell, i);
    work.lights.clear();
    work.ordered.clear();
    glm::vec3 arrival;
    if (settings.estimator == Estimator::kExit) {
      const core::SobolPoints::Point u = points.point(static_cast<std::uint32_t>(i));
      arrival = uniform_direction(unit(u[0]), unit(u[1]));
      const Path start(scene, materials, paths.segments->at(u[2]), arrival);
      find_exits(start, {unit(u[3]), unit(u[4]), unit(u[5])}, settings,
                 Worth(scene.tile(), settings, start.height_mm()), random, work);
    } else {
      const std::uint32_t segment = paths.segments->draw(random);
      const float u_z = random.uniform();
      arrival = uniform_direction(u_z, random.uniform());
      connect_light(Path(scene, materials, segment, arrival), settings, random, work);
    }
    chunk.add(arrival, work.lights);
    if (orders) {
      orders->add(arrival, work.ordered);
    }
    if ((i + 1) % kTransferChunkPaths == 0 || i + 1 == paths.first + paths.count) {
      chunk.flush(sums.sum, sums.sum_of_squares);
      if (orders) {
        orders->flush(sums.order_numbers, sums.order_shapes);
      }
      pass(checkpoint);
    }
  }
  return sums;
}

void add_sums(const TransferSums& more, TransferSums& sums) {
  const auto add = [](const std::vector<std::int64_t>& from, std::vector<std::int64_t>& to) {
    CHECK_EQ(from.size(), to.size());
    std::transform(from.begin(), from.end(), to.begin(), to.begin(), std::plus<>());
  };
  sums.paths += more.paths;
  add(more.sum, sums.sum);
  add(more.sum_of_squares, sums.sum_of_squares);
  add(more.order_numbers, sums.order_numbers);
  add(more.order_shapes, sums.order_shapes);
}

}  // namespace weft::transport
