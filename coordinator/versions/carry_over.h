#pragma once

#include <vector>

#include "shading/fibre_material.h"
#include "storage/recolouring.h"

namespace weft::coordinator {

// Transfer matrices and their standard errors, [cells, 3, (order+1)^2, (order+1)^2].
struct CarriedMatrices {
  std::vector<float> transfer;
  std::vector<float> transfer_se;
};

// The transfer matrices of `fabric` as they are estimated to be in the colours of `materials`,
// without tracing a path (docs/decisions/colourways-by-orders.md). Each channel is taken over from
// those channels of the old ones that need little change. The old colours give the old matrices
// to the bit. REQUIRES: as many materials as there are, of the same widths. Throws
// core::Error(kFailedPrecondition) when the fabric does not tell orders of scattering apart, or was
// traced with colours of which nothing follows for the new ones.
[[nodiscard]] CarriedMatrices carried_matrices(
    const storage::RecolourableDatabase& fabric,
    const std::vector<shading::FibreMaterial>& materials);

// Gives the fabric these matrices, and materials and their tables. The light's orders, which are
// those of the old colours, are removed; everything else stays. REQUIRES and throws: as above.
void carry_over(storage::RecolourableDatabase& fabric,
                const std::vector<shading::FibreMaterial>& materials);

}  // namespace weft::coordinator
