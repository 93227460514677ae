#pragma once

#include <vector>

#include "cli/sample_tracer.h"
#include "coordinator/versions/carry_over.h"

namespace weft::cli {

// The levels at which light carried over in some colours sums up, for each channel and by how often
// it was scattered, to what a few paths that are traced in these colours find in the same cells.
// `carried` is what `levels` gave. Where few paths have come, the level is that of light that was
// scattered less often.
[[nodiscard]] coordinator::OrderLevels traced_levels(
    const coordinator::CarriedSums& carried, const coordinator::OrderLevels& levels,
    const std::vector<shading::FibreBcsdf>& materials, const SampleTracer& tracer);

}  // namespace weft::cli
