#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "core/digest.h"
#include "core/random.h"
#include "fabric/untangle.h"
#include "shading/fibre_bcsdf.h"
#include "transport/distance_fit.h"
#include "transport/float_mode.h"
#include "transport/pca.h"
#include "transport/signed_distance.h"
#include "transport/sphere.h"
#include "transport/transfer.h"
#include "transport/visibility_raster.h"
#include "worker/baker.h"

namespace weft::worker {

namespace {

constexpr std::uint64_t kSeed = 0x77656674;  // "weft"

void add(core::Hasher& hasher, double value) { hasher.number(std::bit_cast<std::uint64_t>(value)); }
void add(core::Hasher& hasher, float value) { hasher.number(std::bit_cast<std::uint32_t>(value)); }

// The functions of libm that bakers and what they call use, in both precisions.
template <class T>
void probe_libm(core::Hasher& hasher) {
  core::Random random(kSeed, 0);
  for (int i = 0; i < 256; ++i) {
    const T u = static_cast<T>(random.uniform_double());
    for (const T value :
         {std::exp(-10 * u), std::log(u + T(1e-9)), std::sin(20 * u - 10), std::cos(20 * u - 10),
          std::tan(u), std::asin(2 * u - 1), std::acos(2 * u - 1), std::atan2(u - T(0.5), T(0.3)),
          std::erf(4 * u - 2), std::pow(u, T(1.7)), std::sqrt(u), std::cbrt(u), std::tanh(u)}) {
      add(hasher, value);
    }
  }
}

// A few crossed fibres, `lift_mm` above one another.
fabric::Tile probe_tile(float lift_mm) {
  fabric::Tile tile;
  tile.size_mm = {1, 1};
  tile.z_min_mm = -0.1f;
  tile.z_max_mm = 0.3f;
  tile.material_names = {"probe"};
  tile.yarn_names = {"probe"};
  tile.threads = {{0, fabric::Role::kExplicit, 0}};
  for (std::uint32_t i = 0; i < 8; ++i) {
    const float across = (static_cast<float>(i) + 0.37f) / 8;
    const float z = i % 2 == 0 ? 0.0f : lift_mm;
    for (const float along : {0.0f, 0.31f, 0.64f, 1.0f}) {
      const float bend = along == 0.31f || along == 0.64f ? 0.03f : 0.0f;
      tile.points_mm.push_back(i % 2 == 0 ? glm::vec3{along, across + bend, z}
                                          : glm::vec3{across + bend, along, z});
    }
    tile.strands.push_back({4 * i, 4, 0, 0, 0.05f, i % 2 == 0 ? 1 : 0, i % 2 == 0 ? 0 : 1});
  }
  fabric::index_segments(tile);
  return tile;
}

// Fibres that lie inside one another are moved apart.
void probe_geometry(core::Hasher& hasher) {
  fabric::Tile tile = probe_tile(0.03f);
  fabric::untangle(tile);
  for (const glm::vec3& point : tile.points_mm) {
    for (int axis = 0; axis < 3; ++axis) {
      add(hasher, point[axis]);
    }
  }
}

void probe_rays(core::Hasher& hasher, const transport::Scene& scene) {
  for (std::uint32_t i = 0; i < 512; ++i) {
    core::Random random(kSeed, i);
    const std::uint32_t segment = random.below(scene.tile().segment_count());
    const float u_z = random.uniform();
    const auto hit = scene.closest(scene.tile().wrapped_midpoint(segment),
                                   transport::uniform_direction(u_z, random.uniform()),
                                   std::numeric_limits<float>::infinity(), scene.own_copy(segment));
    add(hasher, hit ? hit->t_mm : -1.0f);
    hasher.number(hit ? hit->segment : 0);
  }
  const transport::VisibilityRaster raster(scene, 64);
  for (std::uint32_t k = 0; k < 4; ++k) {
    const std::vector<std::uint8_t> bits = raster.bits(k);
    hasher.bytes({reinterpret_cast<const char*>(bits.data()), bits.size()});
    for (const float distance : transport::signed_distance(bits, 64)) {
      add(hasher, distance);
    }
  }
}

void probe_paths(core::Hasher& hasher, const transport::Scene& scene) {
  shading::FibreMaterial material;
  material.c_r = {0.1f, 0.2f, 0.3f};
  material.c_tt = {0.7f, 0.8f, 0.9f};
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf(material)};
  transport::CellSegments cell;
  for (std::uint32_t k = 0; k < scene.tile().segment_count(); ++k) {
    cell.segments.push_back(k);
  }
  transport::TransferSettings settings;
  settings.seed = kSeed;
  const transport::TransferSums sums =
      transport::transfer_sums(scene, materials, {0, &cell, 0, 256}, settings);
  for (const std::int64_t value : sums.sum) {
    hasher.number(static_cast<std::uint64_t>(value));
  }
}

void probe_algebra(core::Hasher& hasher) {
  constexpr std::uint32_t kPixels = 256;
  core::Random random(kSeed, 1);
  std::vector<float> images(64 * kPixels);
  for (float& value : images) {
    value = random.uniform() - 0.5f;
  }
  const transport::DistanceBasis basis = transport::principal_components(images, kPixels, 4, kSeed);
  for (const float value : basis.components) {
    add(hasher, value);
  }
  std::vector<std::uint8_t> bits(kPixels / 8);
  for (std::uint8_t& byte : bits) {
    byte = static_cast<std::uint8_t>(random.below(256));
  }
  for (const float value : transport::DistanceFit(basis, 16).coefficients(bits)) {
    add(hasher, value);
  }
}

}  // namespace

core::Digest numerics_fingerprint() {
  const transport::FlushDenormals flush;  // as bakers do
  core::Hasher hasher;
  hasher.field("weft numerics 4");
  probe_libm<float>(hasher);
  probe_libm<double>(hasher);
  probe_geometry(hasher);
  const fabric::Tile tile = probe_tile(0.2f);
  const transport::Scene scene(tile);
  probe_rays(hasher, scene);
  probe_paths(hasher, scene);
  probe_algebra(hasher);
  return hasher.finish();
}

}  // namespace weft::worker
