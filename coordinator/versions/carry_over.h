#pragma once

#include <array>
#include <vector>

#include "coordinator/versions/scattering_table.h"
#include "shading/fibre_material.h"
#include "storage/recolouring.h"

namespace weft::coordinator {

// What carried-over light of each channel and of each part is multiplied by beside: what paths that
// were traced in the new colours say of the sums over all cells.
struct OrderLevels {
  std::array<OrderParts, 3> of;
  OrderLevels();  // all of them 1
};

// The new matrices as sums of old ones: for a cell and a channel, those of the old channels times
// `channels`, and the shapes times `shapes`.
struct CarriedSums {
  std::vector<std::array<double, 3>> channels;                    // [cells, 3]
  std::vector<std::array<double, 3>> errors;                      // of standard errors
  std::vector<std::array<double, shading::kOrderShapes>> shapes;  // [cells, 3]
  std::vector<OrderParts> light;                                  // [cells, 3] that arrives
};

// Transfer matrices and their standard errors, [cells, 3, (order+1)^2, (order+1)^2].
struct CarriedMatrices {
  std::vector<float> transfer;
  std::vector<float> transfer_se;
};

// The transfer matrices of a fabric as they are estimated to be in other colours, without tracing a
// path (docs/decisions/colourways-by-orders.md). Each channel is taken over from those channels of
// the old ones that need little change. The old colours give the old matrices to the bit. No cell
// gets more light than comes to it, but for levels above 1. Immutable: any thread may call.
class LightCarrier {
 public:
  // `fabric` is kept by reference. Throws core::Error(kFailedPrecondition) when it does not tell
  // orders of scattering apart.
  explicit LightCarrier(const storage::RecolourableDatabase& fabric);

  // REQUIRES: as many materials as there are, of the same widths. Throws
  // core::Error(kFailedPrecondition) when the fabric was traced with colours of which nothing
  // follows for the new ones.
  [[nodiscard]] CarriedSums sums(const std::vector<shading::FibreMaterial>& materials,
                                 const OrderLevels& levels = {}) const;
  [[nodiscard]] CarriedMatrices matrices(const CarriedSums& sums) const;
  // A shape of a cell, [shape_coefficients (incoming), (order+1)^2 (light)]: as it is stored, and
  // the higher harmonics of light that follow (sky_extension.h).
  [[nodiscard]] std::vector<double> shape(std::size_t cell, std::size_t k) const;

 private:
  struct Source;
  [[nodiscard]] std::vector<Source> sources_of(const std::vector<shading::FibreMaterial>& materials,
                                               int channel) const;

  const storage::RecolourableDatabase& fabric_;
  ScatteringTable table_;
  std::vector<double> sky_extension_;
};

}  // namespace weft::coordinator
