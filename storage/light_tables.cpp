#include "storage/light_tables.h"

#include <cmath>
#include <numbers>

#include "core/check.h"
#include "shading/bcsdf_sh.h"
#include "shading/spherical_harmonics.h"

namespace weft::storage {

static_assert(kMaxShOrder == shading::kShMaxOrder);

std::vector<float> scattering_tables(const std::vector<shading::FibreMaterial>& materials,
                                     std::uint32_t order) {
  CHECK_LE(order, kMaxShOrder);
  std::vector<float> tables;
  for (const shading::FibreMaterial& material : materials) {
    const std::vector<float> table = shading::bcsdf_sh_table(material, static_cast<int>(order));
    tables.insert(tables.end(), table.begin(), table.end());
  }
  return tables;
}

std::vector<float> zonal_sharpnesses() {
  std::vector<float> sharpnesses(kZonalSharpnesses);
  for (std::size_t i = 0; i < kZonalSharpnesses; ++i) {
    const double exponent = 4.0 * static_cast<double>(i) / (kZonalSharpnesses - 1);
    sharpnesses[i] = static_cast<float>(std::pow(10.0, exponent));
  }
  return sharpnesses;
}

std::vector<float> zonal_table(std::uint32_t order) {
  CHECK_LE(order, kMaxShOrder);
  std::vector<float> table;
  for (const float sharpness : zonal_sharpnesses()) {
    const shading::ShZonal zonal = shading::sg_zonal(sharpness);
    for (std::uint32_t l = 0; l <= order; ++l) {
      const double norm = std::sqrt((2.0 * l + 1.0) / (4.0 * std::numbers::pi));
      table.push_back(static_cast<float>(norm * static_cast<double>(zonal.a[l])));
    }
  }
  return table;
}

std::vector<float> unrotated_sg_axes(std::uint32_t count) {
  std::vector<float> axes;
  for (std::uint32_t q = 1; q <= count; ++q) {
    const double phi = 4 * std::numbers::pi * q / (1 + std::sqrt(5.0));
    const double z = 1 - (q - 0.5) / count;
    const double r = std::sqrt(1 - z * z);
    axes.insert(axes.end(), {static_cast<float>(r * std::cos(phi)),
                             static_cast<float>(r * std::sin(phi)), static_cast<float>(z)});
  }
  return axes;
}

}  // namespace weft::storage
