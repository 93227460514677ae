#pragma once

#include "fabric/fibres.h"
#include "fabric/tile.h"

namespace weft::fabric {

// Expected number of hairs on one thread, after fibre_share. Every thread gets this number rounded
// up or down at random.
[[nodiscard]] double expected_hairs(const v1::Yarn& yarn, const YarnModel& model, double length_mm);

// Length of the mean hair, from root to tip.
[[nodiscard]] double mean_hair_length_mm(const v1::Yarn& yarn, const YarnModel& model);

// Appends the thread's hairs: strands with period (0, 0) whose root lies in the yarn and whose tip
// stands out of it. Distance from the axis, angle and place along the yarn change evenly from root
// to tip, as in Zhao, Luan, Bala 2016.
void lay_hairs(const FibreJob& job, Tile& tile);

}  // namespace weft::fabric
