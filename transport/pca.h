#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "transport/checkpoint.h"

namespace weft::transport {

// Signed distances are clamped to this before they are analysed (radians): what lies far from an
// edge is of no use to the sign, and the components are spent on edges instead. Half the light of
// the softest Gaussian that reads them alone (sharpness 80) lies within 0.13; its visibility is
// 0.994 at the clamp. docs/performance.md has what other clamps give.
inline constexpr float kDistanceClamp = 0.4f;

// Mean and principal components of signed distances. An image is mean + sum of c_i component_i.
struct DistanceBasis {
  std::uint32_t pixels = 0;
  std::vector<float> mean;        // [pixels] radians
  std::vector<float> components;  // [components, pixels], orthonormal, by falling variance
  std::vector<float> variance;    // [components] of the coefficients over the sample
};

// The `components` leading principal components of `images`, n rows of `pixels` values, by
// subspace iteration from a start that `seed` draws. Single-threaded and in fixed order: the same
// bytes on machines of one kind. With fewer images than components the rest is zero. Overwrites
// `images`.
[[nodiscard]] DistanceBasis principal_components(std::vector<float>& images, std::uint32_t pixels,
                                                 std::uint32_t components, std::uint64_t seed,
                                                 const Checkpoint& checkpoint = {});

// Coefficients [components] of one image of signed distances, clamped as above: its orthogonal
// projection. distance_fit.h finds better ones.
[[nodiscard]] std::vector<float> project(const DistanceBasis& basis,
                                         std::span<const float> distances);

// The image that coefficients stand for.
[[nodiscard]] std::vector<float> reconstruct(const DistanceBasis& basis,
                                             std::span<const float> coefficients);

}  // namespace weft::transport
