#pragma once

#include <cstdint>
#include <memory>

#include "core/half.h"
#include "core/random.h"
#include "render/fabric.h"
#include "shading/bcsdf_sh.h"

namespace weft::render {

// What a fabric of random tables is like.
struct RandomFabric {
  std::uint64_t seed = 1;
  std::uint32_t order = 5;
  std::uint32_t gaussians = 12;
  std::uint32_t components = 4;
  float sigma_shadow_mm = 0.2f;
  std::uint32_t materials = 2;  // or 1; whose tables take a second each
};

inline shading::FibreMaterial random_material(core::Random& random) {
  const auto between = [&](float low, float high) { return low + (high - low) * random.uniform(); };
  shading::FibreMaterial material;
  for (int c = 0; c < 3; ++c) {
    material.c_r[c] = between(0.05f, 0.4f);
    material.c_tt[c] = between(0.3f, 0.9f);
  }
  material.beta_r = between(0.06f, 0.2f);
  material.beta_tt = between(0.1f, 0.3f);
  material.gamma_tt = between(0.3f, 0.6f);
  return material;
}

// Two layers of straight fibres across each other, 1 mm square, of two materials; everything that
// would be precomputed is random, but of the right size: for comparing two ways to shade it.
inline storage::FabricDatabase random_database(const RandomFabric& wanted) {
  constexpr std::uint32_t kFibres = 8;
  constexpr std::uint32_t kSegments = 4;  // of each
  constexpr std::uint32_t kCells = 5;
  constexpr std::uint32_t kResolution = 16;
  core::Random random(wanted.seed, 0x7ab1e5);
  storage::FabricDatabase db;
  db.size_mm = {1, 1};
  db.z_bounds_mm = {-0.08f, 0.08f};
  db.yarn_names = {"yarn"};
  db.threads = {0, 3, 0};
  for (std::uint32_t layer = 0; layer < 2; ++layer) {
    for (std::uint32_t k = 0; k < kFibres; ++k) {
      db.strands.insert(db.strands.end(), {kSegments + 1, (layer + k) % wanted.materials, 0});
      db.strand_periods.insert(db.strand_periods.end(), {layer == 0 ? 1 : 0, layer == 0 ? 0 : 1});
      db.strand_radius_mm.push_back(0.04f);
      for (std::uint32_t i = 0; i <= kSegments; ++i) {
        const float along = static_cast<float>(i) / kSegments;
        const float across = (static_cast<float>(k) + 0.5f) / kFibres;
        const float z = layer == 0 ? -0.04f : 0.04f;
        db.points_mm.insert(db.points_mm.end(),
                            {layer == 0 ? along : across, layer == 0 ? across : along, z});
      }
    }
  }
  const std::uint32_t segments = 2 * kFibres * kSegments;
  for (std::uint32_t k = 0; k < wanted.materials; ++k) {
    db.material_names.push_back(k == 0 ? "first" : "second");
    db.materials.push_back(random_material(random));
  }
  for (const shading::FibreMaterial& material : db.materials) {
    const std::vector<float> table =
        shading::bcsdf_sh_table(material, static_cast<int>(wanted.order));
    db.c_s.insert(db.c_s.end(), table.begin(), table.end());
  }
  db.sigma_shadow_mm = wanted.sigma_shadow_mm;
  db.sh_order = wanted.order;
  const std::size_t harmonics = (std::size_t{wanted.order} + 1) * (std::size_t{wanted.order} + 1);
  for (std::uint32_t cell = 0; cell < kCells; ++cell) {
    db.cell_coordinates.insert(db.cell_coordinates.end(), {cell, 0, 0});
    db.cell_paths.push_back(1);
  }
  db.cells_per_axis = {kCells, 1, 1};
  for (std::size_t i = 0; i < kCells * 3 * harmonics * harmonics; ++i) {
    db.transfer.push_back(random.uniform() * (i % (harmonics + 1) == 0 ? 1.0f : 0.1f));
    db.transfer_se.push_back(0.01f);
  }
  const std::size_t pixels = std::size_t{kResolution} * kResolution;
  db.visibility_resolution = kResolution;
  db.pca_components = wanted.components;
  for (std::size_t i = 0; i < pixels; ++i) {
    db.ssdf_mean.push_back(0.6f * std::sin(0.37f * static_cast<float>(i % 16)) + 0.2f);
  }
  for (std::size_t i = 0; i < pixels * wanted.components; ++i) {
    db.ssdf_basis.push_back(0.3f * std::sin(0.11f * static_cast<float>(i)));
  }
  db.sg_count = wanted.gaussians;
  db.sg_sharpness = 40;
  for (std::uint32_t k = 0; k < segments; ++k) {
    db.cell_of_segment.push_back(random.below(kCells));
    for (std::uint32_t c = 0; c < wanted.components; ++c) {
      db.ssdf.push_back(core::half_from_float(random.uniform() - 0.5f));
    }
    for (std::uint32_t q = 0; q < wanted.gaussians; ++q) {
      db.ssg.push_back(core::half_from_float(0.6f * random.uniform()));
    }
    db.ssg_rotation.push_back(static_cast<std::uint16_t>(random.below(65536)));
    const std::uint32_t kind = random.below(8);  // some see everything, some nothing
    db.open_share.push_back(core::half_from_float(kind == 0 ? 0.0f : kind == 1 ? 1.0f : 0.5f));
  }
  return db;
}

inline std::shared_ptr<const Fabric> random_fabric(const RandomFabric& wanted) {
  return Fabric::from_database(random_database(wanted), Fabric::Wanted::kFibresAndTransfer);
}

}  // namespace weft::render
