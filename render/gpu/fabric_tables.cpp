#include "render/gpu/fabric_tables.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <glm/packing.hpp>

#include "core/check.h"
#include "core/error.h"
#include "core/half.h"
#include "render/cloth.h"

namespace weft::render::gpu {
namespace {

using shading::FabricTables;

static_assert(sizeof(shading::DeviceFabricSizes) == 48);
static_assert(sizeof(shading::DeviceSegment) == 24);

// Kernels count entries in 32-bit integers.
constexpr std::uint64_t kMostEntries = std::numeric_limits<std::int32_t>::max();
constexpr std::size_t kMostMaterials = 65536;
// Of the standard error, that rounding to halves may add (storage/database_writer.cpp).
constexpr double kRoundingShare = 0.1;

void refuse_unless(bool fits, const std::string& what, std::uint64_t count, std::uint64_t limit) {
  if (!fits) {
    throw core::Error(core::Code::kResourceExhausted, "the fabric has " + std::to_string(count) +
                                                          " " + what + " and a device takes " +
                                                          std::to_string(limit) +
                                                          "; draw it with --device cpu");
  }
}

double root_mean_square(const std::vector<float>& values, bool of_rounding) {
  double sum = 0;
  for (const float value : values) {
    const float x =
        of_rounding ? core::float_from_half(core::half_from_float(value)) - value : value;
    sum += static_cast<double>(x) * static_cast<double>(x);
  }
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

bool halves_suffice(const storage::FabricDatabase& db) {
  const double rounding = root_mean_square(db.transfer, true);
  return std::isfinite(rounding) &&
         rounding <= kRoundingShare * root_mean_square(db.transfer_se, false);
}

std::uint32_t pair_of_halves(glm::vec2 pair) { return glm::packHalf2x16(pair); }

void append(std::vector<float>& to, glm::vec3 v) { to.insert(to.end(), {v.x, v.y, v.z}); }

void pack_floats(const PrecomputedFabric& fabric, FabricArrays& arrays) {
  const FabricTables tables = fabric.tables();
  std::vector<float>& floats = arrays.floats;
  const auto place = [&] { return static_cast<int>(floats.size()); };
  arrays.sizes.first_axis = place();
  for (int q = 0; q < tables.sizes.gaussians; ++q) {
    append(floats, shading::gaussian_axis(tables, q));
  }
  arrays.sizes.first_material = place();
  for (const shading::FibreBcsdf& bcsdf : fabric.bcsdfs()) {
    const shading::FibreLobes& lobes = bcsdf.lobes();
    append(floats, lobes.c_r);
    append(floats, lobes.c_tt);
    floats.insert(floats.end(),
                  {lobes.precision_r, lobes.precision_tt, lobes.kappa_tt, lobes.azimuth_norm});
  }
  arrays.sizes.first_lobe = place();
  for (const shading::FibreBcsdf& bcsdf : fabric.bcsdfs()) {
    for (int i = 0; i <= shading::kLobeTableCells; ++i) {
      const glm::vec2 entry = shading::lobe_table_entry(bcsdf.lobes().table, i);
      floats.insert(floats.end(), {entry.x, entry.y});
    }
  }
  arrays.sizes.first_c_s = place();
  const std::vector<float>& c_s = fabric.database().c_s;
  floats.insert(floats.end(), c_s.begin(), c_s.end());
}

void pack_segments(const Fabric& fabric, FabricArrays& arrays) {
  const PrecomputedFabric& precomputed = *fabric.precomputed();
  const FabricTables tables = precomputed.tables();
  const storage::FabricDatabase& db = precomputed.database();
  const auto segments = static_cast<std::uint32_t>(db.cell_of_segment.size());
  CHECK_EQ(segments, fabric.tile().segment_count());
  const int gaussian_pairs = (tables.sizes.gaussians + 1) / 2;
  for (std::uint32_t k = 0; k < segments; ++k) {
    const auto s = static_cast<int>(k);
    const auto rotation = static_cast<std::uint32_t>(shading::gaussian_rotation(tables, s));
    arrays.segments.push_back({db.cell_of_segment[k],
                               precomputed.material_of_segment(k) << 16 | rotation,
                               shading::open_share(tables, s), tangent_of(fabric.tile(), k)});
    for (int pair = 0; pair < tables.sizes.ssdf_pairs; ++pair) {
      arrays.ssdf_factors.push_back(pair_of_halves(shading::ssdf_factors(tables, s, pair)));
    }
    for (int pair = 0; pair < gaussian_pairs; ++pair) {
      const bool both = 2 * pair + 1 < tables.sizes.gaussians;
      arrays.gaussians.push_back(
          pair_of_halves({shading::gaussian_weight(tables, s, 2 * pair),
                          both ? shading::gaussian_weight(tables, s, 2 * pair + 1) : 0.0f}));
    }
  }
  const int pixels = tables.sizes.resolution * tables.sizes.resolution;
  for (int pixel = 0; pixel < pixels; ++pixel) {
    for (int pair = 0; pair < tables.sizes.ssdf_pairs; ++pair) {
      arrays.ssdf_basis.push_back(pair_of_halves(shading::ssdf_basis(tables, pixel, pair)));
    }
  }
}

void pack_transfer(const PrecomputedFabric& fabric, FabricArrays& arrays) {
  const FabricTables tables = fabric.tables();
  const shading::DeviceFabricSizes& sizes = arrays.sizes;
  arrays.cells = static_cast<std::uint32_t>(fabric.database().cell_paths.size());
  const bool half = sizes.transfer_is_half != 0;
  arrays.words_per_cell = std::uint64_t{3} * static_cast<std::uint64_t>(sizes.harmonics) *
                          static_cast<std::uint64_t>(sizes.quads) * (half ? 2 : 4);
  arrays.transfer.reserve(arrays.words_per_cell * arrays.cells);
  for (std::uint32_t cell = 0; cell < arrays.cells; ++cell) {
    for (int channel = 0; channel < 3; ++channel) {
      for (int j0 = 0; j0 < sizes.harmonics; ++j0) {
        for (int quad = 0; quad < sizes.quads; ++quad) {
          const glm::vec4 rows =
              shading::transfer_rows(tables, static_cast<int>(cell), channel, j0, quad);
          if (half) {
            arrays.transfer.push_back(pair_of_halves({rows.x, rows.y}));
            arrays.transfer.push_back(pair_of_halves({rows.z, rows.w}));
          } else {
            for (int i = 0; i < 4; ++i) {
              arrays.transfer.push_back(glm::floatBitsToUint(rows[i]));
            }
          }
        }
      }
    }
  }
}

template <class T>
std::uint64_t bytes_of(const std::vector<T>& values) {
  return values.size() * sizeof(T);
}

}  // namespace

std::uint64_t FabricArrays::size_bytes() const {
  return sizeof(sizes) + bytes_of(floats) + bytes_of(segments) + bytes_of(ssdf_basis) +
         bytes_of(ssdf_factors) + bytes_of(gaussians) + bytes_of(transfer);
}

FabricArrays pack_fabric(const Fabric& fabric) {
  CHECK(fabric.precomputed() != nullptr);
  const PrecomputedFabric& precomputed = *fabric.precomputed();
  const FabricTables tables = precomputed.tables();
  const storage::FabricDatabase& db = precomputed.database();
  refuse_unless(precomputed.bcsdfs().size() <= kMostMaterials, "materials",
                precomputed.bcsdfs().size(), kMostMaterials);
  const std::uint64_t widest =
      std::max<std::uint64_t>(static_cast<std::uint64_t>(tables.sizes.ssdf_pairs),
                              static_cast<std::uint64_t>(tables.sizes.gaussians));
  const std::uint64_t entries = db.cell_of_segment.size() * widest;
  refuse_unless(entries <= kMostEntries, "entries of visibility", entries, kMostEntries);
  refuse_unless(db.c_s.size() <= kMostEntries / 2, "entries of material tables", db.c_s.size(),
                kMostEntries / 2);
  FabricArrays arrays;
  arrays.sizes.resolution = tables.sizes.resolution;
  arrays.sizes.ssdf_pairs = tables.sizes.ssdf_pairs;
  arrays.sizes.gaussians = tables.sizes.gaussians;
  arrays.sizes.sharpness = tables.sizes.sharpness;
  arrays.sizes.harmonics = tables.sizes.harmonics;
  arrays.sizes.quads = (tables.sizes.harmonics + 3) / 4;
  arrays.sizes.transfer_is_half = halves_suffice(db) ? 1 : 0;
  arrays.sizes.sigma_shadow_mm = db.sigma_shadow_mm;
  pack_floats(precomputed, arrays);
  pack_segments(fabric, arrays);
  pack_transfer(precomputed, arrays);
  return arrays;
}

DeviceFabricTables::DeviceFabricTables(Device& device, const FabricArrays& arrays)
    : sizes_(device.upload(std::as_bytes(std::span(&arrays.sizes, 1)), "sizes of a fabric")),
      floats_(device.upload(arrays.floats, "materials of a fabric")),
      segments_(device.upload(arrays.segments, "segments of a fabric")),
      ssdf_basis_(device.upload(arrays.ssdf_basis, "components of signed distances")),
      ssdf_factors_(device.upload(arrays.ssdf_factors, "signed distances of segments")),
      gaussians_(device.upload(arrays.gaussians, "visibility Gaussians of segments")),
      cells_(arrays.cells),
      harmonics_(static_cast<std::uint32_t>(arrays.sizes.harmonics)) {
  const std::uint64_t cell_bytes = arrays.words_per_cell * sizeof(std::uint32_t);
  const std::uint64_t most =
      std::min<std::uint64_t>(device.info().max_buffer_bytes, kMostEntries * sizeof(std::uint32_t));
  const auto page_cells = static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(most / cell_bytes, 1, std::max<std::uint32_t>(cells_, 1)));
  for (std::uint32_t first = 0; first < cells_; first += page_cells) {
    const std::uint32_t count = std::min(page_cells, cells_ - first);
    const std::span<const std::uint32_t> words(
        arrays.transfer.data() + first * arrays.words_per_cell, count * arrays.words_per_cell);
    pages_.push_back({device.upload(std::as_bytes(words), "transfer matrices"), first, count});
  }
}

std::vector<const Buffer*> DeviceFabricTables::buffers() const {
  return {&sizes_, &floats_, &segments_, &ssdf_basis_, &ssdf_factors_, &gaussians_};
}

}  // namespace weft::render::gpu
