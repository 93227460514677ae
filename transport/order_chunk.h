#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "transport/path_counts.h"
#include "transport/sh_chunk.h"

namespace weft::transport {

// Light that a path has found, and how it was scattered on the way.
struct OrderedLight {
  LightSample light;
  PathCounts counts;
  std::uint32_t scatterings = 0;  // 1 or more
};

// Sums over a few hundred paths of their light by orders of scattering (shading/
// scattering_orders.h), and their transfer to fixed point. Order matters within a chunk and nowhere
// else.
class OrderChunk {
 public:
  // REQUIRES: 1 to kMostCountedMaterials materials.
  OrderChunk(std::uint32_t sh_order, std::size_t materials);

  // Sums of [groups, kOrderBins, 3, 1 + order_counts]: the light itself, and the light times each
  // of its counts.
  [[nodiscard]] std::size_t numbers() const { return numbers_.size(); }
  // Sums of [kOrderShapes, low, low]: matrices of the channels' mean, low = shape_coefficients.
  [[nodiscard]] std::size_t shape_entries() const { return shapes_.size(); }

  void add(glm::vec3 arrival, std::span<const OrderedLight> lights);

  // Adds the sums to fixed-point ones and starts anew; they saturate at ShChunk::kLargestSum.
  void flush(std::span<std::int64_t> numbers, std::span<std::int64_t> shapes);

 private:
  void count(const OrderedLight& found);

  std::size_t materials_;
  std::size_t low_;
  std::vector<double> numbers_;
  std::vector<float> shapes_;
  bool empty_ = true;
};

}  // namespace weft::transport
