#include "coordinator/versions/carry_over.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "coordinator/versions/sky_extension.h"
#include "core/check.h"
#include "core/error.h"
#include "core/half.h"

namespace weft::coordinator {

namespace {

using shading::FibreMaterial;
using Fabric = storage::RecolourableDatabase;

// Nothing follows from light that there was none of.
std::optional<double> ratio(double from, double to) {
  if (from > 0) {
    return to / from;
  }
  return to > 0 ? std::nullopt : std::optional(1.0);
}

std::optional<MaterialGains> gains_between(const std::vector<FibreMaterial>& from, int channel_from,
                                           const std::vector<FibreMaterial>& to, int channel_to) {
  MaterialGains gains;
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

// Colours that brighten rest on fewer paths than colours that darken.
double effort_of(double gain) {
  const double steps = std::log(std::max(gain, 1e-30));
  return steps > 0 ? 2 * steps : -steps;
}

double sum_of(const OrderParts& parts) {
  double sum = 0;
  for (const double part : parts) {
    sum += part;
  }
  return sum;
}

// Light after gains and levels. By gains, what was scattered least first, there is no more than
// comes from all directions of a white sky, if the old light was not; levels have been measured.
OrderParts light_after(const OrderParts& light, const OrderParts& gains, const OrderParts& levels) {
  double left = std::max(4 * std::numbers::pi, sum_of(light));
  OrderParts after{};
  for (std::size_t part = 0; part < kOrderParts; ++part) {
    const double gained = std::min(left, light[part] * gains[part]);
    left -= gained;
    after[part] = gained * levels[part];
  }
  return after;
}

}  // namespace

OrderLevels::OrderLevels() {
  for (OrderParts& levels : of) {
    levels.fill(1);
  }
}

// A channel of the new colours, as a channel of the old ones with these gains.
struct LightCarrier::Source {
  std::size_t channel = 0;
  std::vector<OrderParts> gains;  // [cells]
  double weight = 1;              // beside other sources of the same channel
};

LightCarrier::LightCarrier(const Fabric& fabric)
    : fabric_([&]() -> const Fabric& {
        if (!fabric.recolouring.has_orders()) {
          throw core::Error(
              core::Code::kFailedPrecondition,
              "the fabric does not hold how often its light was scattered, which other colours "
              "follow from: an older weft made it, or it has more than four materials, or the "
              "paper's estimator; make it again with 'weft run' or 'weft submit'");
        }
        return fabric;
      }()),
      table_(fabric),
      sky_extension_(sky_extension(fabric.database.sh_order)) {}

// The old channels that a new one is taken over from: the less they must change, the more they
// count, so that a small step of a colour is never a jump of its light; and what must grow a
// thousandfold counts a thousand times less than that.
std::vector<LightCarrier::Source> LightCarrier::sources_of(
    const std::vector<FibreMaterial>& materials, int channel) const {
  constexpr double kPower = 4;
  std::vector<Source> sources;
  double least = std::numeric_limits<double>::infinity();
  for (const int candidate : {channel, (channel + 1) % 3, (channel + 2) % 3}) {
    const std::optional<MaterialGains> gains =
        gains_between(fabric_.database.materials, candidate, materials, channel);
    if (!gains) {
      continue;
    }
    Source source;
    source.channel = static_cast<std::size_t>(candidate);
    double after = 0;
    double effort = 0;
    for (std::size_t cell = 0; cell < table_.cells(); ++cell) {
      source.gains.push_back(table_.gains(cell, source.channel, *gains));
      const OrderParts& light = table_.light(cell, source.channel);
      for (std::size_t part = 0; part < kOrderParts; ++part) {
        const double gain = source.gains.back()[part];
        after += light[part] * gain;
        effort += light[part] * gain * effort_of(gain);
      }
    }
    source.weight = after > 0 ? effort / after : 0;
    if (source.weight == 0) {
      source.weight = 1;
      sources.clear();
      sources.push_back(std::move(source));
      return sources;
    }
    least = std::min(least, source.weight);
    sources.push_back(std::move(source));
  }
  if (sources.empty()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "the fabric was traced with colours of which a channel is exactly 0, and "
                      "nothing follows from them for brighter ones; trace the new colours "
                      "(--exact)");
  }
  double sum = 0;
  for (Source& source : sources) {
    source.weight = std::pow(least / source.weight, kPower) * std::exp(least - source.weight);
    sum += source.weight;
  }
  for (Source& source : sources) {
    source.weight /= sum;
  }
  return sources;
}

// A' = g_1 A + sum over shapes of (g_k - g_1) A_k: what the shapes do not have, light scattered
// once and harmonics of incoming light beyond theirs, goes with light scattered once. A shape is
// stored for the mean of the channels, and is as bright in one of them as that one's light is.
CarriedSums LightCarrier::sums(const std::vector<FibreMaterial>& materials,
                               const OrderLevels& levels) const {
  CHECK_EQ(materials.size(), fabric_.database.materials.size());
  const std::size_t rows = table_.cells() * 3;
  CarriedSums sums{
      std::vector<std::array<double, 3>>(rows), std::vector<std::array<double, 3>>(rows),
      std::vector<std::array<double, shading::kOrderShapes>>(rows), std::vector<OrderParts>(rows)};
  for (std::size_t channel = 0; channel < 3; ++channel) {
    for (const Source& source : sources_of(materials, static_cast<int>(channel))) {
      for (std::size_t cell = 0; cell < table_.cells(); ++cell) {
        const std::size_t row = cell * 3 + channel;
        const OrderParts& light = table_.light(cell, source.channel);
        const OrderParts after = light_after(light, source.gains[cell], levels.of[channel]);
        const double before = sum_of(light);
        const auto gain = [&](std::size_t part) {
          return light[part] > 0 ? after[part] / light[part] : 1;
        };
        sums.channels[row][source.channel] += source.weight * gain(0);
        sums.errors[row][source.channel] +=
            source.weight * (before > 0 ? sum_of(after) / before : 1);
        for (std::size_t part = 0; part < kOrderParts; ++part) {
          sums.light[row][part] += source.weight * after[part];
        }
        for (std::size_t k = 0; k < shading::kOrderShapes; ++k) {
          const double mean = (table_.light(cell, 0)[1 + k] + table_.light(cell, 1)[1 + k] +
                               table_.light(cell, 2)[1 + k]) /
                              3;
          const double brightness = mean > 0 ? light[1 + k] / mean : 0;
          sums.shapes[row][k] += source.weight * (gain(1 + k) - gain(0)) * brightness;
        }
      }
    }
  }
  return sums;
}

std::vector<double> LightCarrier::shape(std::size_t cell, std::size_t k) const {
  const std::size_t order = fabric_.database.sh_order;
  const std::size_t n = (order + 1) * (order + 1);
  const std::size_t low = shading::shape_coefficients(fabric_.database.sh_order);
  const std::uint16_t* stored =
      &fabric_.recolouring.order_shapes[(cell * shading::kOrderShapes + k) * low * low];
  std::vector<double> result(low * n);
  for (std::size_t j1 = 0; j1 < low; ++j1) {
    double* row = &result[j1 * n];
    for (std::size_t j0 = 0; j0 < low; ++j0) {
      row[j0] = value_of(stored[j1 * low + j0]);
    }
    for (std::size_t high = low; high < n; ++high) {
      const double* extension = &sky_extension_[(high - low) * low];
      for (std::size_t j0 = 0; j0 < low; ++j0) {
        row[high] += extension[j0] * row[j0];
      }
    }
  }
  return result;
}

CarriedMatrices LightCarrier::matrices(const CarriedSums& sums) const {
  const storage::FabricDatabase& database = fabric_.database;
  const std::size_t n = std::size_t{database.sh_order + 1} * (std::size_t{database.sh_order} + 1);
  std::array<std::vector<double>, shading::kOrderShapes> shapes;
  CarriedMatrices carried{std::vector<float>(database.transfer.size()),
                          std::vector<float>(database.transfer_se.size())};
  for (std::size_t row = 0; row < table_.cells() * 3; ++row) {
    const std::size_t cell = row / 3;
    for (std::size_t k = 0; k < shading::kOrderShapes && row % 3 == 0; ++k) {
      shapes[k] = shape(cell, k);
    }
    float* transfer = &carried.transfer[row * n * n];
    float* errors = &carried.transfer_se[row * n * n];
    for (std::size_t c = 0; c < 3; ++c) {
      const auto gain = static_cast<float>(sums.channels[row][c]);
      const auto gain_of_errors = static_cast<float>(sums.errors[row][c]);
      const std::size_t from = (cell * 3 + c) * n * n;
      for (std::size_t i = 0; i < n * n && (gain != 0 || gain_of_errors != 0); ++i) {
        transfer[i] += gain * database.transfer[from + i];
        errors[i] += gain_of_errors * database.transfer_se[from + i];
      }
    }
    for (std::size_t k = 0; k < shading::kOrderShapes; ++k) {
      const std::vector<double>& of = shapes[k];
      for (std::size_t i = 0; i < of.size() && sums.shapes[row][k] != 0; ++i) {
        transfer[i] += static_cast<float>(sums.shapes[row][k] * of[i]);
      }
    }
  }
  return carried;
}

}  // namespace weft::coordinator
