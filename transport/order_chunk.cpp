#include "transport/order_chunk.h"

#include <algorithm>

#include "core/check.h"
#include "core/moments.h"
#include "shading/spherical_harmonics.h"

namespace weft::transport {

namespace {

std::uint32_t met(const PathCounts::Material& of) { return of.reflections + of.transmissions; }

// See shading::order_groups.
std::size_t group_of(const OrderedLight& found, std::size_t materials) {
  if (materials == 1) {
    return 0;
  }
  const auto& of = found.counts.of;
  std::size_t most = 0;
  for (std::size_t m = 1; m < materials; ++m) {
    most = met(of[m]) > met(of[most]) ? m : most;
  }
  return 2 * most + (met(of[most]) == found.scatterings ? 0 : 1);
}

template <class Value>
void move_sums(std::vector<Value>& from, std::span<std::int64_t> to) {
  CHECK_EQ(from.size(), to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    to[i] += core::to_fixed_point(
        std::clamp(static_cast<double>(from[i]), -ShChunk::kLargestSum, ShChunk::kLargestSum));
  }
  std::fill(from.begin(), from.end(), Value{0});
}

}  // namespace

OrderChunk::OrderChunk(std::uint32_t sh_order, std::size_t materials)
    : materials_(materials),
      low_(shading::shape_coefficients(sh_order)),
      numbers_(shading::order_groups(materials) * shading::kOrderBins * 3 *
               (1 + shading::order_counts(materials))),
      shapes_(shading::kOrderShapes * low_ * low_) {
  CHECK_GE(materials, 1U);
  CHECK_LE(materials, shading::kMostCountedMaterials);
}

void OrderChunk::count(const OrderedLight& found) {
  const std::size_t width = 1 + shading::order_counts(materials_);
  const std::size_t bin = shading::order_bin(found.scatterings);
  const std::size_t row = group_of(found, materials_) * shading::kOrderBins + bin;
  for (int c = 0; c < 3; ++c) {
    double* sums = &numbers_[(row * 3 + static_cast<std::size_t>(c)) * width];
    const double weight = found.light.weight[c];
    sums[0] += weight;
    sums[1] += weight * found.scatterings;
    for (std::size_t m = 0; m < materials_; ++m) {
      const PathCounts::Material& of = found.counts.of[m];
      sums[2 + 2 * m] += weight * static_cast<double>(of.coloured[c]);
      sums[3 + 2 * m] += weight * of.transmissions;
    }
  }
}

void OrderChunk::add(glm::vec3 arrival, std::span<const OrderedLight> lights) {
  if (lights.empty()) {
    return;
  }
  empty_ = false;
  const shading::ShVector at = shading::sh_evaluate(arrival);
  for (const OrderedLight& found : lights) {
    count(found);
    if (found.scatterings < 2) {
      continue;
    }
    const std::size_t shape = shading::shape_of_bin(shading::order_bin(found.scatterings));
    const shading::ShVector from = shading::sh_evaluate(found.light.direction);
    const glm::vec3& w = found.light.weight;
    const float mean = (w.x + w.y + w.z) / 3;
    for (std::size_t j1 = 0; j1 < low_; ++j1) {
      const float row = mean * at.c[j1];
      float* sums = &shapes_[(shape * low_ + j1) * low_];
      for (std::size_t j0 = 0; j0 < low_; ++j0) {
        sums[j0] += row * from.c[j0];
      }
    }
  }
}

void OrderChunk::flush(std::span<std::int64_t> numbers, std::span<std::int64_t> shapes) {
  if (empty_) {
    return;
  }
  move_sums(numbers_, numbers);
  move_sums(shapes_, shapes);
  empty_ = true;
}

}  // namespace weft::transport
