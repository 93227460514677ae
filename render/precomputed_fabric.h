#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "shading/fibre_bcsdf.h"
#include "shading/light_harmonics.h"
#include "shading/multiple_scattering.h"
#include "shading/single_scattering.h"
#include "storage/fabric_database.h"

namespace weft::render {

struct PrecomputedSettings {
  // Visibility of a Gaussian light is taken from the sum of Gaussians up to sharpness blend_low,
  // from the signed distance above blend_high, and blended linearly in between (Khungurn et al.
  // 2017, section 5.2.2, with 100 and 200; docs/accuracy.md has the study).
  float blend_low = 20;
  float blend_high = 80;
  int gamma_method = shading::kGammaHybrid;  // or kGammaClosed, kGammaGl12
};

// What the paper does (its 48 Gaussians a segment are a matter of the database).
inline constexpr PrecomputedSettings kPaperSettings{100, 200, shading::kGammaClosed};

// Where an eye ray met a fibre, prepared for any number of lights. All directions of this header
// are unit vectors in the frame of the flat fabric that point away from the hit.
struct ShadingPoint : shading::SeenFibre {
  std::uint32_t segment = 0;
  const shading::FibreBcsdf* bcsdf = nullptr;  // of the PrecomputedFabric
  std::array<shading::ShVector, 3> c_s;        // C_S per channel, turned into the flat fabric
};

// A light's harmonics after the transfer of every cell, c_T = A c_light: [cells, 3 channels].
struct CellRadiance {
  std::vector<shading::ShVector> c_t;
};

// Local shading from a fabric database (Khungurn et al. 2017, sections 5.2 and 5.3): what one fibre
// hit sends to the eye of light that came through its own cloth. Global shadows are the caller's.
// Light from below the horizon of the flat fabric counts nothing, for the precomputation knows
// none. Results are RGB per unit of irradiance on a plane that faces the light. Immutable: any
// thread may call.
class PrecomputedFabric {
 public:
  // Throws core::Error(kDataLoss) when the database's arrays contradict one another.
  explicit PrecomputedFabric(storage::FabricDatabase database,
                             const PrecomputedSettings& settings = {});

  // REQUIRES: segment is one of the fabric's; tangent is its unit tangent.
  [[nodiscard]] ShadingPoint point(std::uint32_t segment, glm::vec3 tangent,
                                   glm::vec3 omega_o) const;
  [[nodiscard]] const shading::FibreBcsdf& bcsdf_of_segment(std::uint32_t segment) const;
  [[nodiscard]] const storage::FabricDatabase& database() const { return db_; }
  // The tables as the shared text of shading/ reads them; as long as this object lives.
  [[nodiscard]] shading::FabricTables tables() const;
  [[nodiscard]] const std::vector<shading::FibreBcsdf>& bcsdfs() const { return bcsdfs_; }
  [[nodiscard]] std::uint32_t material_of_segment(std::uint32_t segment) const {
    return material_of_segment_[segment];
  }
  [[nodiscard]] const PrecomputedSettings& settings() const { return settings_; }

  // Single scattering, V S cos(theta), under a directional light.
  [[nodiscard]] glm::vec3 single_directional(const ShadingPoint& at, glm::vec3 omega_d) const;
  // Single scattering under the normalised spherical Gaussian light G / M.
  [[nodiscard]] glm::vec3 single_sg(const ShadingPoint& at,
                                    const shading::SphericalGaussian& light) const;
  // The same by other settings than its own.
  [[nodiscard]] glm::vec3 single_sg(const ShadingPoint& at, const shading::SphericalGaussian& light,
                                    const PrecomputedSettings& settings) const;

  // The parts of the above, for callers that bring their own visibility.
  [[nodiscard]] static glm::vec3 unoccluded_directional(const ShadingPoint& at, glm::vec3 omega_d);
  [[nodiscard]] glm::vec3 unoccluded_sg(const ShadingPoint& at,
                                        const shading::SphericalGaussian& light) const;
  // Angle from omega to the nearest edge of what the segment sees, radians, negative where it sees
  // nothing; at most the angle to the horizon, +-pi for segments that see all or nothing.
  [[nodiscard]] float signed_distance(std::uint32_t segment, glm::vec3 omega) const;
  // V = [signed distance > 0].
  [[nodiscard]] bool sees(std::uint32_t segment, glm::vec3 omega) const;

  // Multiple scattering c_S . (D(R) A c_light). The truncated and noisy series may fall below zero:
  // cutting it here would make its mean too bright, so that only whole pixels are cut.
  // light_cells does the product once for all cells, for lights that come from one direction of
  // the flat fabric everywhere; the other overload does it for the hit's cell alone.
  [[nodiscard]] CellRadiance light_cells(const shading::ShVector& c_light) const;
  [[nodiscard]] glm::vec3 multiple(const ShadingPoint& at, const CellRadiance& light) const;
  [[nodiscard]] glm::vec3 multiple(const ShadingPoint& at, const shading::ShVector& c_light) const;

 private:
  void take_basis();

  storage::FabricDatabase db_;
  PrecomputedSettings settings_;
  std::vector<shading::FibreBcsdf> bcsdfs_;  // by material
  std::vector<std::uint32_t> material_of_segment_;
  std::vector<float> basis_;        // [pixels, 1 + components]: mean, basis
  std::vector<glm::vec3> sg_axes_;  // of rotation 0
};

// c_light of a light of unit irradiance.
[[nodiscard]] shading::ShVector harmonics_of_directional(glm::vec3 omega_d);
[[nodiscard]] shading::ShVector harmonics_of_sg(const shading::SphericalGaussian& light);

}  // namespace weft::render
