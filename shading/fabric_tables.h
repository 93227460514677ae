#pragma once

#include <cstddef>
#include <cstdint>

#include <glm/gtc/packing.hpp>

#include "shading/dialect.h"

// How C++ reaches the tables of a fabric from the shared text that shades it: signed_distance.h,
// gaussian_visibility.h, multiple_scattering.h. A kernel defines WEFT_SHADING_FABRIC_TABLES, the
// type FabricTables and these functions over its own buffers before it includes them.

namespace weft::shading {

// Sizes that loops need.
struct FabricSizes {
  int resolution = 0;   // of the visibility maps; even
  int ssdf_pairs = 0;   // of entries of the signed distance: the mean, then the components
  int gaussians = 0;    // per segment
  float sharpness = 0;  // of each
  int harmonics = 0;    // (order + 1)^2
};

// Arrays of a storage::FabricDatabase that lives longer; FabricDatabase names their axes.
struct FabricTables {
  FabricSizes sizes;
  std::size_t components = 0;
  const float* basis = nullptr;  // [pixels, 1 + components]: mean, basis
  const std::uint16_t* ssdf = nullptr;
  const std::uint16_t* gaussians = nullptr;
  const std::uint16_t* rotations = nullptr;
  const std::uint16_t* open_shares = nullptr;
  const glm::vec3* axes = nullptr;  // [gaussians], before rotation
  const float* c_s = nullptr;
  const float* transfer = nullptr;
};

[[nodiscard]] inline FabricSizes fabric_sizes(const FabricTables& t) { return t.sizes; }

// Visible share of the sphere.
[[nodiscard]] inline float open_share(const FabricTables& t, int segment) {
  return glm::unpackHalf1x16(t.open_shares[segment]);
}

// Entries 2 pair and 2 pair + 1 of a pixel: entry 0 is the mean, entry k component k - 1.
[[nodiscard]] inline vec2 ssdf_basis(const FabricTables& t, int pixel, int pair) {
  const std::size_t first = static_cast<std::size_t>(pair) * 2;
  const float* entries = t.basis + static_cast<std::size_t>(pixel) * (t.components + 1);
  return {entries[first], first + 1 <= t.components ? entries[first + 1] : 0.0f};
}

// Their factors for a segment; that of the mean is one.
[[nodiscard]] inline vec2 ssdf_factors(const FabricTables& t, int segment, int pair) {
  const std::size_t first = static_cast<std::size_t>(pair) * 2;
  const std::uint16_t* factors = t.ssdf + static_cast<std::size_t>(segment) * t.components;
  return {first == 0 ? 1.0f : glm::unpackHalf1x16(factors[first - 1]),
          first < t.components ? glm::unpackHalf1x16(factors[first]) : 0.0f};
}

// Steradians.
[[nodiscard]] inline float gaussian_weight(const FabricTables& t, int segment, int q) {
  return glm::unpackHalf1x16(
      t.gaussians[static_cast<std::size_t>(segment) * static_cast<std::size_t>(t.sizes.gaussians) +
                  static_cast<std::size_t>(q)]);
}
[[nodiscard]] inline vec3 gaussian_axis(const FabricTables& t, int q) { return t.axes[q]; }
// Of the axes about z, in 65,536ths of a turn.
[[nodiscard]] inline int gaussian_rotation(const FabricTables& t, int segment) {
  return t.rotations[segment];
}

// C_S at row 0 ... kBcsdfShAngles - 1 of theta_o.
[[nodiscard]] inline float c_s_entry(const FabricTables& t, int material, int channel, int row,
                                     int j) {
  const auto angles = static_cast<std::size_t>(512);
  const std::size_t rows =
      (static_cast<std::size_t>(material) * 3 + static_cast<std::size_t>(channel)) * angles;
  return t
      .c_s[(rows + static_cast<std::size_t>(row)) * static_cast<std::size_t>(t.sizes.harmonics) +
           static_cast<std::size_t>(j)];
}

// Rows 4 quad ... 4 quad + 3 of column j0 of a transfer matrix, zero beyond the last row.
[[nodiscard]] inline vec4 transfer_rows(const FabricTables& t, int cell, int channel, int j0,
                                        int quad) {
  const auto n = static_cast<std::size_t>(t.sizes.harmonics);
  const float* matrix =
      t.transfer +
      (static_cast<std::size_t>(cell) * 3 + static_cast<std::size_t>(channel)) * n * n +
      static_cast<std::size_t>(j0);
  const std::size_t first = static_cast<std::size_t>(quad) * 4;
  const auto row = [&](std::size_t j1) { return j1 < n ? matrix[j1 * n] : 0.0f; };
  return {row(first), row(first + 1), row(first + 2), row(first + 3)};
}

}  // namespace weft::shading
