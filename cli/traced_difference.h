#pragma once

#include <vector>

#include "cli/sample_tracer.h"
#include "coordinator/versions/carry_over.h"
#include "shading/fibre_bcsdf.h"
#include "storage/fabric_database.h"

namespace weft::cli {

// By how much carried-over matrices differ from those of a few paths that are traced in their
// colours, in the mean of many cells: orders of scattering do not say that light which one lobe
// scatters comes from elsewhere than light which the other does. The cells of each yarn are looked
// at by themselves.
class TracedDifference {
 public:
  // `carried` has the carried-over transfer, whose light is that of `sums`, and the new colours,
  // which `materials` are of. What is within the noise is left out.
  TracedDifference(const storage::FabricDatabase& carried, const coordinator::CarriedSums& sums,
                   const std::vector<shading::FibreBcsdf>& materials, const SampleTracer& tracer);

  // Adds to carried-over transfer what the cells lack, in proportion to their light.
  void mend(storage::FabricDatabase& carried, const coordinator::CarriedSums& sums) const;

 private:
  std::vector<std::size_t> yarn_of_cell_;
  std::vector<double> differences_;  // [yarns, 3, n, n] per light
};

}  // namespace weft::cli
