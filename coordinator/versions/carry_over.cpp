#include "coordinator/versions/carry_over.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "core/half.h"
#include "shading/scattering_orders.h"
#include "storage/light_tables.h"

namespace weft::coordinator {

namespace {

using shading::FibreMaterial;
using shading::kOrderBins;
using Fabric = storage::RecolourableDatabase;

// What a scattering's weight is multiplied by: by C_R, and by (1 - C_R) C_TT.
struct LobeGains {
  double reflect = 1;
  double transmit = 1;
};
using Gains = std::vector<LobeGains>;  // by material

// Nothing follows from light that there was none of.
std::optional<double> ratio(double from, double to) {
  if (from > 0) {
    return to / from;
  }
  return to > 0 ? std::nullopt : std::optional(1.0);
}

std::optional<Gains> gains_between(const std::vector<FibreMaterial>& from, int channel_from,
                                   const std::vector<FibreMaterial>& to, int channel_to) {
  Gains gains;
  for (std::size_t m = 0; m < from.size(); ++m) {
    const double r_from = from[m].c_r[channel_from];
    const double r_to = to[m].c_r[channel_to];
    const auto reflect = ratio(r_from, r_to);
    const auto transmit = ratio((1 - r_from) * static_cast<double>(from[m].c_tt[channel_from]),
                                (1 - r_to) * static_cast<double>(to[m].c_tt[channel_to]));
    if (!reflect || !transmit) {
      return std::nullopt;
    }
    gains.push_back({*reflect, *transmit});
  }
  return gains;
}

double value_of(std::uint16_t half) { return static_cast<double>(core::float_from_half(half)); }

// Light of one cell and one channel, by groups and orders, and what it becomes by other gains.
class OrderedLight {
 public:
  OrderedLight(const Fabric& fabric, std::size_t cell, int channel)
      : fabric_(fabric),
        groups_(shading::order_groups(fabric.database.materials.size())),
        counts_(shading::order_counts(fabric.database.materials.size())),
        first_row_(cell * groups_ * kOrderBins * 3 + static_cast<std::size_t>(channel)) {}

  struct Sums {
    double before = 0;
    double after = 0;
    double effort = 0;  // how much the light must change, weighted by what it becomes
    void add(const Sums& other) {
      before += other.before;
      after += other.after;
      effort += other.effort;
    }
    // 1 where there is no light.
    [[nodiscard]] double gain() const { return before > 0 ? after / before : 1; }
  };

  [[nodiscard]] Sums of_bin(std::size_t bin, const Gains& gains) const {
    Sums sums;
    for (std::size_t group = 0; group < groups_; ++group) {
      const std::size_t row = first_row_ + (group * kOrderBins + bin) * 3;
      const double light = value_of(fabric_.recolouring.order_light[row]);
      if (light > 0) {
        const double gain = gain_of_row(row, bin, gains);
        sums.before += light;
        sums.after += light * gain;
        sums.effort += light * gain * effort_of(gain);
      }
    }
    return sums;
  }

 private:
  // Colours that brighten rest on fewer paths than colours that darken.
  static double effort_of(double gain) {
    const double steps = std::log(std::max(gain, 1e-30));
    return steps > 0 ? 2 * steps : -steps;
  }

  // E[product over scatterings of their gains]. The lobes of a path are taken for independent draws
  // in the proportions of the row: q is the mean gain of one scattering, and the sum over n
  // scatterings is E[q^n]. n is binomial within a bin of several orders, geometric in the last one,
  // with the mean that the row has.
  [[nodiscard]] double gain_of_row(std::size_t row, std::size_t bin, const Gains& gains) const {
    constexpr double kLeastRest = 0.05;  // of a geometric series that may not converge any more
    const std::size_t at = row * counts_;
    const double first = shading::kFirstOrder[bin];
    const double mean = std::max(first, value_of(fabric_.recolouring.order_counts[at]));
    double change = 0;
    for (std::size_t m = 0; m < gains.size(); ++m) {
      change +=
          value_of(fabric_.recolouring.order_counts[at + 1 + 2 * m]) * (gains[m].reflect - 1) +
          value_of(fabric_.recolouring.order_counts[at + 2 + 2 * m]) * (gains[m].transmit - 1);
    }
    const double q = std::max(0.0, 1 + change / mean);
    const double more = mean - first;
    if (bin + 1 == kOrderBins) {
      return std::pow(q, first) / std::max(kLeastRest, 1 + more * (1 - q));
    }
    const double width = shading::kFirstOrder[bin + 1] - 1 - first;
    const double within =
        width > 0 ? std::pow(1 + std::min(1.0, more / width) * (q - 1), width) : 1;
    return std::pow(q, first) * within;
  }

  const Fabric& fabric_;
  std::size_t groups_;
  std::size_t counts_;
  std::size_t first_row_;
};

// A channel of the new colours, as a channel of the old ones with these gains.
struct Source {
  int channel = 0;
  Gains gains;
  double weight = 1;  // beside other sources of the same channel
};

std::size_t cells_of(const Fabric& fabric) { return fabric.database.cell_paths.size(); }

double effort_of(const Fabric& fabric, const Source& source) {
  OrderedLight::Sums sums;
  for (std::size_t cell = 0; cell < cells_of(fabric); ++cell) {
    const OrderedLight light(fabric, cell, source.channel);
    for (std::size_t bin = 0; bin < kOrderBins; ++bin) {
      sums.add(light.of_bin(bin, source.gains));
    }
  }
  return sums.after > 0 ? sums.effort / sums.after : 0;
}

// The old channels that a new one is taken over from: the less they must change, the more they
// count, so that a small step of a colour is never a jump of its light.
std::vector<Source> sources_of(const Fabric& fabric, const std::vector<FibreMaterial>& materials,
                               int channel) {
  constexpr double kPower = 4;
  std::vector<Source> sources;
  double least = std::numeric_limits<double>::infinity();
  for (const int candidate : {channel, (channel + 1) % 3, (channel + 2) % 3}) {
    const std::optional<Gains> gains =
        gains_between(fabric.database.materials, candidate, materials, channel);
    if (gains) {
      Source source{candidate, *gains, 1};
      source.weight = effort_of(fabric, source);
      if (source.weight == 0) {
        source.weight = 1;
        return {source};
      }
      least = std::min(least, source.weight);
      sources.push_back(std::move(source));
    }
  }
  if (sources.empty()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "the fabric was traced with colours of which a channel is exactly 0, and "
                      "nothing follows from them for brighter ones; trace the new colours "
                      "(--exact)");
  }
  double sum = 0;
  for (Source& source : sources) {
    source.weight = std::pow(least / source.weight, kPower);
    sum += source.weight;
  }
  for (Source& source : sources) {
    source.weight /= sum;
  }
  return sources;
}

// Matrices of one cell in the new colours. [3, n, n] each.
struct CellMatrices {
  const float* transfer;
  const float* error;
  float* new_transfer;
  float* new_error;
  std::size_t n;
};

// Gains of what was scattered once, and of the shapes; and how bright each shape is in the channel
// over the mean of the channels that it is stored for.
struct ShapeGains {
  double once = 1;
  double all = 1;
  std::array<double, shading::kOrderShapes> of{};
  std::array<double, shading::kOrderShapes> brightness{};
};

ShapeGains shape_gains(const Fabric& fabric, std::size_t cell, const Source& source) {
  ShapeGains gains;
  OrderedLight::Sums total;
  std::array<OrderedLight::Sums, shading::kOrderShapes> shapes;
  std::array<double, shading::kOrderShapes> mean{};
  for (std::size_t bin = 0; bin < kOrderBins; ++bin) {
    const OrderedLight::Sums sums =
        OrderedLight(fabric, cell, source.channel).of_bin(bin, source.gains);
    total.add(sums);
    if (bin == 0) {
      gains.once = sums.gain();
      continue;
    }
    shapes[shading::shape_of_bin(bin)].add(sums);
    for (int c = 0; c < 3; ++c) {
      mean[shading::shape_of_bin(bin)] +=
          OrderedLight(fabric, cell, c).of_bin(bin, source.gains).before / 3;
    }
  }
  gains.all = total.gain();
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    gains.of[k] = shapes[k].gain();
    gains.brightness[k] = mean[k] > 0 ? shapes[k].before / mean[k] : 0;
  }
  return gains;
}

// A' = g_1 A + sum over shapes of (g_k - g_1) A_k: what the shapes do not have, light scattered
// once and harmonics beyond theirs, goes with light scattered once.
void recolour_cell(const Fabric& fabric, std::size_t cell, const Source& source, int channel,
                   const CellMatrices& at) {
  const ShapeGains gains = shape_gains(fabric, cell, source);
  const std::size_t entries = at.n * at.n;
  const std::size_t from = static_cast<std::size_t>(source.channel) * entries;
  const std::size_t to = static_cast<std::size_t>(channel) * entries;
  for (std::size_t i = 0; i < entries; ++i) {
    at.new_transfer[to + i] +=
        static_cast<float>(source.weight * gains.once) * at.transfer[from + i];
    at.new_error[to + i] += static_cast<float>(source.weight * gains.all) * at.error[from + i];
  }
  const std::size_t low = shading::shape_coefficients(fabric.database.sh_order);
  for (std::size_t k = 0; k < shading::kOrderShapes; ++k) {
    const double share = source.weight * (gains.of[k] - gains.once) * gains.brightness[k];
    const std::uint16_t* shape =
        &fabric.recolouring.order_shapes[(cell * shading::kOrderShapes + k) * low * low];
    for (std::size_t j1 = 0; j1 < low; ++j1) {
      for (std::size_t j0 = 0; j0 < low; ++j0) {
        at.new_transfer[to + j1 * at.n + j0] +=
            static_cast<float>(share * value_of(shape[j1 * low + j0]));
      }
    }
  }
}

}  // namespace

CarriedMatrices carried_matrices(const Fabric& fabric,
                                 const std::vector<FibreMaterial>& materials) {
  const storage::FabricDatabase& database = fabric.database;
  CHECK_EQ(materials.size(), database.materials.size());
  if (!fabric.recolouring.has_orders()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "the fabric does not hold how often its light was scattered, which other "
                      "colours follow from: an older weft made it, or it has more than four "
                      "materials, or the paper's estimator; make it again with 'weft run' or 'weft "
                      "submit'");
  }
  const std::size_t n = std::size_t{database.sh_order + 1} * (std::size_t{database.sh_order} + 1);
  CarriedMatrices carried{std::vector<float>(database.transfer.size()),
                          std::vector<float>(database.transfer_se.size())};
  for (int channel = 0; channel < 3; ++channel) {
    for (const Source& source : sources_of(fabric, materials, channel)) {
      for (std::size_t cell = 0; cell < cells_of(fabric); ++cell) {
        const std::size_t first = cell * 3 * n * n;
        recolour_cell(fabric, cell, source, channel,
                      {&database.transfer[first], &database.transfer_se[first],
                       &carried.transfer[first], &carried.transfer_se[first], n});
      }
    }
  }
  return carried;
}

void carry_over(Fabric& fabric, const std::vector<FibreMaterial>& materials) {
  CarriedMatrices carried = carried_matrices(fabric, materials);
  storage::FabricDatabase& database = fabric.database;
  database.transfer = std::move(carried.transfer);
  database.transfer_se = std::move(carried.transfer_se);
  database.materials = materials;
  database.c_s = storage::scattering_tables(materials, database.sh_order);
  fabric.recolouring = {};
}

}  // namespace weft::coordinator
