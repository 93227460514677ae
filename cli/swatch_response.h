#pragma once

#include <array>
#include <vector>

#include "cli/swatch_colour.h"
#include "coordinator/versions/carry_over.h"
#include "shading/fibre_material.h"
#include "storage/fabric_database.h"

namespace weft::cli {

// The measuring scene, drawn once for all colours: fibres scatter by 1, C_R and (1 - C_R) C_TT
// times what does not depend on colour (docs/decisions/colourways-by-orders.md), so that the mean
// of a picture is linear in these, and in transfer for what is scattered more than once, which is
// itself a sum of the old channels' and of the shapes.
class SwatchResponse {
 public:
  SwatchResponse(const storage::FabricDatabase& base, const coordinator::LightCarrier& carrier,
                 unsigned threads);

  // What yarn_colours draws, at exposure 1, of the base with these materials and this transfer, but
  // that there pixels are cut at 0.
  [[nodiscard]] std::vector<YarnColour> colours(
      const std::vector<shading::FibreMaterial>& materials,
      const coordinator::CarriedSums& sums) const;

 private:
  // Factors 1, C_R and (1 - C_R) C_TT.
  static constexpr std::size_t kParts = 3;
  using Parts = std::array<double, kParts>;
  // Sums over the pixels that show one yarn, one material and one cell.
  struct Group {
    std::size_t yarn = 0;
    std::size_t material = 0;
    std::size_t cell = 0;
    double pixels = 0;
    Parts single{};
    std::array<Parts, 3> of_channels{};                    // by the transfer of old channels
    std::array<Parts, shading::kOrderShapes> of_shapes{};  // ... and by the shapes
  };
  struct Light;
  struct Seen;
  void take(const Seen& seen, const storage::FabricDatabase& database,
            const coordinator::LightCarrier& carrier, const Light& light);

  std::size_t yarns_;
  double picture_pixels_ = 0;
  std::vector<Group> groups_;
};

}  // namespace weft::cli
