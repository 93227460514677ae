#pragma once

#include <array>
#include <vector>

#include "cli/swatch_colour.h"
#include "shading/fibre_material.h"
#include "shading/spherical_harmonics.h"
#include "storage/fabric_database.h"

namespace weft::cli {

// The measuring scene, drawn once for all colours: fibres scatter by 1, C_R and (1 - C_R) C_TT
// times what does not depend on colour (docs/decisions/colourways-by-orders.md), so that the mean
// of a picture is linear in these, and in transfer for what is scattered more than once.
class SwatchResponse {
 public:
  explicit SwatchResponse(storage::FabricDatabase database, unsigned threads);

  // What yarn_colours draws, at exposure 1, of the database with these materials and this transfer,
  // but that there pixels are cut at 0.
  [[nodiscard]] std::vector<YarnColour> colours(
      const std::vector<shading::FibreMaterial>& materials,
      const std::vector<float>& transfer) const;

 private:
  // Factors 1, C_R and (1 - C_R) C_TT.
  static constexpr std::size_t kParts = 3;
  // Sums over the pixels that show one yarn, one material and one cell.
  struct Group {
    std::size_t yarn = 0;
    std::size_t material = 0;
    std::size_t cell = 0;
    double pixels = 0;
    std::array<double, kParts> single{};
    std::array<std::array<double, shading::kShMaxCount>, kParts> c_s{};
  };

  std::size_t yarns_;
  std::size_t harmonics_;  // (order + 1)^2
  double picture_pixels_ = 0;
  std::array<double, shading::kShMaxCount> c_light_{};
  std::vector<Group> groups_;
};

}  // namespace weft::cli
