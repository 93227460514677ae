#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/error.h"
#include "fabric/build.h"
#include "fabric/draft.h"
#include "fabric/explicit_fibres.h"
#include "fabric/fibres.h"
#include "fabric/hairs.h"
#include "fabric/layout.h"
#include "fabric/weave_layout.h"

namespace weft::fabric {

namespace {

constexpr double kMostCount = 1e18;  // what a double holds of fibres before we stop counting

struct Sum {
  double fibres = 0;
  double segments = 0;
  double nodes = 0;  // of the yarns' centre curves
};

std::uint64_t whole(double value) {
  return static_cast<std::uint64_t>(std::clamp(std::nearbyint(value), 0.0, kMostCount));
}

// `count` threads of one yarn, each this long.
void add_threads(Sum& sum, const v1::Exemplar& exemplar, const v1::Yarn& yarn,
                 const YarnModel& model, double count, double length_mm) {
  const double segment = exemplar.segment_length_radii() * model.fibre_radius_mm;
  const double regular = count * model.plies * model.fibres_per_ply;
  const double hairs = count * expected_hairs(yarn, model, length_mm);
  sum.fibres += regular + hairs;
  sum.segments += regular * std::max(2.0, std::nearbyint(length_mm / segment)) +
                  hairs * std::max(2.0, std::nearbyint(mean_hair_length_mm(yarn, model) / segment));
}

void fill(TileEstimate& estimate, const Sum& sum) {
  estimate.fibres = whole(sum.fibres);
  estimate.segments = whole(sum.segments);
  const double points = sum.segments + sum.fibres;
  estimate.memory_bytes =
      whole(points * sizeof(glm::vec3) + sum.fibres * sizeof(Strand) +
            sum.segments * sizeof(std::uint32_t) + 2 * sum.nodes * sizeof(YarnNode));
}

// As many copies of a curve as it takes until it is back where it began, modulo the larger tile.
double copies_joined(const YarnCurve& curve, double repeats_x, double repeats_y) {
  const auto around = [](double repeats, int period) {
    const auto count = static_cast<std::uint64_t>(repeats);
    return count / std::gcd(count, static_cast<std::uint64_t>(std::abs(period)));
  };
  return static_cast<double>(
      std::lcm(around(repeats_x, curve.period.x), around(repeats_y, curve.period.y)));
}

// Threads as straight lines: never more than the crimped ones.
Sum straight_weave(const v1::FabricDescription& description, const Draft& draft) {
  const v1::Weave& weave = description.weave();
  const double repeats_x = description.exemplar().repeats_x();
  const double repeats_y = description.exemplar().repeats_y();
  Sum sum;
  const auto add = [&](const std::vector<std::string>& yarns, double crossings, double per_cm,
                       double repeats_across, double repeats_along) {
    const double length = crossings * 10 / per_cm * repeats_along;
    std::vector<double> threads(static_cast<std::size_t>(description.yarns_size()), 0.0);
    for (const std::string& name : yarns) {
      threads[yarn_index(description, name)] += repeats_across;
    }
    for (std::size_t y = 0; y < threads.size(); ++y) {
      if (threads[y] > 0) {
        const v1::Yarn& yarn = description.yarns(static_cast<int>(y));
        add_threads(sum, description.exemplar(), yarn,
                    yarn_model(yarn, yarn.yarn_radius_mm(), description.exemplar()), threads[y],
                    length);
      }
    }
    sum.nodes += static_cast<double>(yarns.size()) * crossings * repeats_across * repeats_along *
                 kNodesPerCrossing;
  };
  add(draft.end_yarns, draft.picks, weave.picks_per_cm(), repeats_x, repeats_y);
  add(draft.pick_yarns, draft.ends, weave.ends_per_cm(), repeats_y, repeats_x);
  return sum;
}

}  // namespace

TileEstimate estimate_tile(const v1::FabricDescription& description) {
  TileEstimate estimate;
  const double repeats_x = description.exemplar().repeats_x();
  const double repeats_y = description.exemplar().repeats_y();
  if (description.has_explicit_fibres()) {
    return estimate_explicit_fibres(description);
  }
  if (description.has_weave()) {
    const Draft draft = draft_of(description.weave());
    estimate.ends = static_cast<std::uint32_t>(std::min(draft.ends * repeats_x, 4e9));
    estimate.picks = static_cast<std::uint32_t>(std::min(draft.picks * repeats_y, 4e9));
    fill(estimate, straight_weave(description, draft));
    if (estimate.memory_bytes > kTileLimitBytes) {
      return estimate;  // too large even so: do not lay it out to say by how much
    }
  }
  const YarnLayout layout = lay_out(description);
  Sum sum;
  for (const YarnCurve& curve : layout.curves) {
    const double joined = copies_joined(curve, repeats_x, repeats_y);
    const v1::Yarn& yarn = description.yarns(static_cast<int>(curve.yarn));
    add_threads(sum, description.exemplar(), yarn,
                yarn_model(yarn, curve.radius_mm, description.exemplar()),
                repeats_x * repeats_y / joined, length_mm(curve, layout.size_mm) * joined);
    sum.nodes += static_cast<double>(curve.nodes.size()) * repeats_x * repeats_y;
  }
  fill(estimate, sum);
  return estimate;
}

}  // namespace weft::fabric
