#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "shading/scattering_orders.h"
#include "storage/recolouring.h"

namespace weft::coordinator {

// What the weight of a scattering by a material is multiplied by: by C_R, and by (1 - C_R) C_TT.
struct LobeGains {
  double reflect = 1;
  double transmit = 1;
};
using MaterialGains = std::vector<LobeGains>;

// Light that was scattered once, and that of each of the shapes (shading/scattering_orders.h).
inline constexpr std::size_t kOrderParts = 1 + shading::kOrderShapes;
using OrderParts = std::array<double, kOrderParts>;

// How the light of a fabric's cells was scattered, as is known of few paths: what few of a cell's
// paths tell is mixed with what those of all cells tell. Immutable: any thread may call.
class ScatteringTable {
 public:
  // REQUIRES: the fabric has orders of scattering.
  explicit ScatteringTable(const storage::RecolourableDatabase& fabric);

  [[nodiscard]] std::size_t cells() const { return cells_; }
  // The integral of a channel's transfer over both of its directions.
  [[nodiscard]] const OrderParts& light(std::size_t cell, std::size_t channel) const {
    return light_[cell * 3 + channel];
  }
  // What that light is multiplied by. Exactly 1 by gains of 1.
  [[nodiscard]] OrderParts gains(std::size_t cell, std::size_t channel,
                                 const MaterialGains& gains) const;

 private:
  struct Pooled;
  void take_cell(const storage::Recolouring& orders, std::size_t cell, double paths,
                 const Pooled& pooled);

  std::size_t cells_;
  std::size_t groups_;
  std::size_t counts_;
  std::vector<OrderParts> light_;  // [cells, 3]
  // [cells, 3, groups, bins, 1 + counts]: a row's share of the light of its part, and its mean
  // numbers of scatterings.
  std::vector<float> rows_;
};

}  // namespace weft::coordinator
