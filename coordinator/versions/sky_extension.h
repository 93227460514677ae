#pragma once

#include <cstddef>
#include <vector>

namespace weft::coordinator {

// Light comes from above the horizon only. So a function of its direction that is smooth there has
// harmonics of all orders, which follow from the lowest ones: p is the harmonic series of order 3
// whose product with the upper hemisphere has nearly those, and its higher ones are what p has.
// Returns [harmonics of `sh_order` above shading::kShapeOrder, those up to it]; empty if there are
// none. REQUIRES: sh_order <= shading::kShMaxOrder.
[[nodiscard]] std::vector<double> sky_extension(std::size_t sh_order);

}  // namespace weft::coordinator
