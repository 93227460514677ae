#pragma once

#include <cstdint>
#include <vector>

#include "shading/fibre_material.h"

namespace weft::storage {

inline constexpr std::uint32_t kMaxShOrder = 5;
inline constexpr std::size_t kZonalSharpnesses = 128;

// C_S of every material, [materials, 3, 512, (order+1)^2], for FabricDatabase::c_s (Khungurn et al.
// 2017, section 5.3.1). REQUIRES: order <= kMaxShOrder.
[[nodiscard]] std::vector<float> scattering_tables(
    const std::vector<shading::FibreMaterial>& materials, std::uint32_t order);

// 128 sharpnesses from 1 to 10,000, evenly spaced in their logarithm.
[[nodiscard]] std::vector<float> zonal_sharpnesses();

// C_G[lambda, l], [128, order + 1]: the zonal coefficients of a normalised spherical Gaussian about
// +z, sqrt((2 l + 1) / (4 pi)) A_l(lambda). REQUIRES: order <= kMaxShOrder.
[[nodiscard]] std::vector<float> zonal_table(std::uint32_t order);

// Axes of the visibility Gaussians before any rotation, [count, 3].
[[nodiscard]] std::vector<float> unrotated_sg_axes(std::uint32_t count);

}  // namespace weft::storage
