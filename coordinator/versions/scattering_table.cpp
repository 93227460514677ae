#include "coordinator/versions/scattering_table.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/half.h"

namespace weft::coordinator {

namespace {

using shading::kOrderBins;

// As many paths of a cell tell as much about it as those of all cells do.
constexpr double kPathsOfOthers = 8;
constexpr double kWholeSphere = 4 * std::numbers::pi;

double value_of(std::uint16_t half) { return static_cast<double>(core::float_from_half(half)); }

std::size_t part_of_bin(std::size_t bin) { return bin == 0 ? 0 : 1 + shading::shape_of_bin(bin); }

double power(double base, std::uint32_t exponent) {
  double result = 1;
  for (; exponent > 0; exponent /= 2) {
    result *= exponent % 2 == 1 ? base : 1;
    base *= base;
  }
  return result;
}

// E[product over scatterings of their gains]. The lobes of a path are taken for independent draws
// in the proportions of the row: q is the mean gain of one scattering, and the sum over n
// scatterings is E[q^n]. n is binomial within a bin of several orders, geometric in the last one,
// with the mean that the row has.
double gain_of_row(const float* counts, std::size_t bin, const MaterialGains& gains) {
  constexpr double kLeastRest = 0.05;  // of a geometric series that may not converge any more
  constexpr double kMost = 1e30;       // more than any light, and finite
  const std::uint32_t first = shading::kFirstOrder[bin];
  const double mean = std::max<double>(first, static_cast<double>(counts[0]));
  double change = 0;
  for (std::size_t m = 0; m < gains.size(); ++m) {
    change += static_cast<double>(counts[1 + 2 * m]) * (gains[m].reflect - 1) +
              static_cast<double>(counts[2 + 2 * m]) * (gains[m].transmit - 1);
  }
  const double q = std::max(0.0, 1 + change / mean);
  const double more = mean - first;
  if (bin + 1 == kOrderBins) {
    return std::min(kMost, power(q, first) / std::max(kLeastRest, 1 + more * (1 - q)));
  }
  const std::uint32_t width = shading::kFirstOrder[bin + 1] - 1 - first;
  const double within = width > 0 ? power(1 + std::min(1.0, more / width) * (q - 1), width) : 1;
  return std::min(kMost, power(q, first) * within);
}

}  // namespace

// Sums over all cells, [groups, bins, 3, ...].
struct ScatteringTable::Pooled {
  std::vector<double> light;
  std::vector<double> counts;  // times light
};

ScatteringTable::ScatteringTable(const storage::RecolourableDatabase& fabric)
    : cells_(fabric.database.cell_paths.size()),
      groups_(shading::order_groups(fabric.database.materials.size())),
      counts_(shading::order_counts(fabric.database.materials.size())),
      light_(cells_ * 3),
      rows_(cells_ * 3 * groups_ * kOrderBins * (1 + counts_)) {
  const storage::Recolouring& orders = fabric.recolouring;
  const std::size_t rows = groups_ * kOrderBins * 3;
  Pooled pooled{std::vector<double>(rows), std::vector<double>(rows * counts_)};
  for (std::size_t i = 0; i < orders.order_light.size(); ++i) {
    const double light = value_of(orders.order_light[i]);
    pooled.light[i % rows] += light;
    for (std::size_t k = 0; k < counts_ && light > 0; ++k) {
      pooled.counts[i % rows * counts_ + k] +=
          light * value_of(orders.order_counts[i * counts_ + k]);
    }
  }
  for (std::size_t cell = 0; cell < cells_; ++cell) {
    take_cell(orders, cell, static_cast<double>(fabric.database.cell_paths[cell]), pooled);
  }
}

void ScatteringTable::take_cell(const storage::Recolouring& orders, std::size_t cell, double paths,
                                const Pooled& pooled) {
  const std::size_t rows = groups_ * kOrderBins * 3;
  const auto light_of = [&](std::size_t row) {
    return value_of(orders.order_light[cell * rows + row]);
  };
  std::array<OrderParts, 3> of_others{};
  for (std::size_t row = 0; row < rows; ++row) {
    const std::size_t part = part_of_bin(row / 3 % kOrderBins);
    light_[cell * 3 + row % 3][part] += light_of(row);
    of_others[row % 3][part] += pooled.light[row];
  }
  // Paths end and split so that those that are left carry 1 in their brightest channel.
  const auto brightest = [](double a, double b, double c) { return std::max({a, b, c}); };
  OrderParts paths_of_part{};
  for (std::size_t part = 0; part < kOrderParts; ++part) {
    paths_of_part[part] =
        paths / kWholeSphere *
        brightest(light_[cell * 3][part], light_[cell * 3 + 1][part], light_[cell * 3 + 2][part]);
  }
  for (std::size_t row = 0; row < rows; ++row) {
    const std::size_t channel = row % 3;
    const std::size_t bin = row / 3 % kOrderBins;
    const std::size_t part = part_of_bin(bin);
    const std::size_t first = row - channel;
    const double light = light_of(row);
    const double paths_of_row =
        paths / kWholeSphere * brightest(light_of(first), light_of(first + 1), light_of(first + 2));
    // What was scattered once is known well enough, and belongs to the cell.
    const double others = part == 0 ? 0 : kPathsOfOthers;
    const auto mixed = [&](double own, double weight, double other) {
      return weight + others > 0 ? (weight * own + others * other) / (weight + others) : 0;
    };
    float* to = &rows_[((cell * 3 + channel) * groups_ * kOrderBins + row / 3) * (1 + counts_)];
    const double of_part = light_[cell * 3 + channel][part];
    const double of_all = of_others[channel][part];
    to[0] = static_cast<float>(mixed(of_part > 0 ? light / of_part : 0, paths_of_part[part],
                                     of_all > 0 ? pooled.light[row] / of_all : 0));
    for (std::size_t k = 0; k < counts_; ++k) {
      const double own = value_of(orders.order_counts[(cell * rows + row) * counts_ + k]);
      const double other =
          pooled.light[row] > 0 ? pooled.counts[row * counts_ + k] / pooled.light[row] : 0;
      to[1 + k] = static_cast<float>(mixed(own, light > 0 ? paths_of_row : 0, other));
    }
  }
}

OrderParts ScatteringTable::gains(std::size_t cell, std::size_t channel,
                                  const MaterialGains& gains) const {
  const OrderParts& light = light_[cell * 3 + channel];
  OrderParts result;
  result.fill(1);
  const float* row = &rows_[(cell * 3 + channel) * groups_ * kOrderBins * (1 + counts_)];
  for (std::size_t group = 0; group < groups_; ++group) {
    for (std::size_t bin = 0; bin < kOrderBins; ++bin, row += 1 + counts_) {
      const std::size_t part = part_of_bin(bin);
      if (row[0] > 0 && light[part] > 0) {
        result[part] += static_cast<double>(row[0]) * (gain_of_row(row + 1, bin, gains) - 1);
      }
    }
  }
  // Shares are rounded, so that their sum may be a little above 1.
  for (double& gain : result) {
    gain = std::max(0.0, gain);
  }
  return result;
}

}  // namespace weft::coordinator
