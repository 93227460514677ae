#include "fabric/weave_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "core/error.h"

namespace weft::fabric {

namespace {

// The stiffer side keeps at least this share of the crimp.
constexpr double kLeastCrimpShare = 0.2;
// A yarn spreads over this share of its room, so that others can pass between it and the next one.
constexpr double kSpread = 0.8;
// A yarn may be narrower than its room by this much before it counts as not fitting.
constexpr double kRoomSlack = 1e-9;

// The threads of one direction, as the layout sees them.
struct ThreadSet {
  const char* name;       // for messages: "ends", "picks"
  double spacing_mm = 0;  // from thread to thread
  std::vector<std::uint32_t> yarns;
  std::vector<double> radii_mm;
  std::vector<double> flattenings;
  std::vector<double> half_widths_mm;
  std::vector<double> half_heights_mm;
};

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g", value);
  return text.data();
}

ThreadSet thread_set(const v1::FabricDescription& description,
                     const std::vector<std::string>& yarns, const char* name, double per_cm) {
  if (!(per_cm > 0) || !std::isfinite(per_cm)) {
    throw core::Error(core::Code::kInvalidArgument, std::string("the weave has no ") + name +
                                                        " per centimetre; give a positive number");
  }
  ThreadSet set;
  set.name = name;
  set.spacing_mm = 10 / per_cm;
  for (const std::string& yarn_name : yarns) {
    const std::uint32_t index = yarn_index(description, yarn_name);
    const v1::Yarn& yarn = description.yarns(static_cast<int>(index));
    set.yarns.push_back(index);
    set.radii_mm.push_back(yarn.yarn_radius_mm());
    set.flattenings.push_back(yarn.flattening());
  }
  return set;
}

// Neighbours share the room between them in proportion to their radii. A yarn spreads in its room,
// as yarns of finished cloth do, as far as its flattening allows; its area stays.
void press_sideways(ThreadSet& set, const v1::FabricDescription& description) {
  const std::size_t count = set.yarns.size();
  for (std::size_t k = 0; k < count; ++k) {
    const double radius = set.radii_mm[k];
    double room = set.spacing_mm;
    for (const std::size_t neighbour : {(k + 1) % count, (k + count - 1) % count}) {
      room = std::min(room, set.spacing_mm * radius / (radius + set.radii_mm[neighbour]));
    }
    const double spread = std::min(radius / (1 - set.flattenings[k]), kSpread * room);
    room = std::max(std::min(radius, room), spread);
    const double least = radius * (1 - set.flattenings[k]);
    if (room < least * (1 - kRoomSlack)) {
      const std::string& yarn = description.yarns(static_cast<int>(set.yarns[k])).name();
      throw core::Error(core::Code::kInvalidArgument,
                        std::string(set.name) + " that lie " + number(set.spacing_mm) +
                            " mm apart leave yarn '" + yarn + "' a width of " + number(2 * room) +
                            " mm, but with a radius of " + number(radius) +
                            " mm and a flattening of " + number(set.flattenings[k]) + " it needs " +
                            number(2 * least) + " mm; use at most " +
                            number(10 / set.spacing_mm * room / least) + " " + set.name +
                            " per cm, a thinner yarn or more flattening");
    }
    set.half_widths_mm.push_back(room);
    set.half_heights_mm.push_back(radius * radius / room);
  }
}

// How much a set of threads withstands bending: thick yarns that change sides often.
double stiffness(const ThreadSet& set, double changes, double other_spacing_mm,
                 std::size_t crossings) {
  double sum = 0;
  for (const double radius : set.radii_mm) {
    sum += radius * radius;
  }
  const double length = static_cast<double>(crossings) * other_spacing_mm;
  const double per_mm = changes / (static_cast<double>(set.radii_mm.size()) * length);
  const double value = sum / static_cast<double>(set.radii_mm.size()) * per_mm;
  return value * value;
}

// Share of the crimp that the warp takes.
double warp_share(const Draft& draft, const ThreadSet& ends, const ThreadSet& picks) {
  double along_warp = 0;
  double along_weft = 0;
  for (std::uint32_t p = 0; p < draft.picks; ++p) {
    for (std::uint32_t e = 0; e < draft.ends; ++e) {
      along_warp += draft.warp_up(p, e) != draft.warp_up((p + 1) % draft.picks, e) ? 1 : 0;
      along_weft += draft.warp_up(p, e) != draft.warp_up(p, (e + 1) % draft.ends) ? 1 : 0;
    }
  }
  const double warp = stiffness(ends, along_warp, picks.spacing_mm, draft.picks);
  const double weft = stiffness(picks, along_weft, ends.spacing_mm, draft.ends);
  const double share = warp + weft > 0 ? weft / (warp + weft) : 0.5;
  return std::clamp(share, kLeastCrimpShare, 1 - kLeastCrimpShare);
}

// A thread over crossings `spacing_mm` apart at the given heights, as (distance along, height).
std::vector<glm::dvec2> crimp(const std::vector<double>& heights_mm, double spacing_mm) {
  std::vector<glm::dvec2> line;
  for (std::size_t k = 0; k < heights_mm.size(); ++k) {
    const double from = heights_mm[k];
    const double to = heights_mm[(k + 1) % heights_mm.size()];
    for (std::uint32_t n = 0; n < kNodesPerCrossing; ++n) {
      const double f = static_cast<double>(n) / kNodesPerCrossing;
      line.emplace_back((static_cast<double>(k) + 0.5 + f) * spacing_mm,
                        from + (to - from) * 0.5 * (1 - std::cos(std::numbers::pi * f)));
    }
  }
  return line;
}

YarnCurve thread_curve(const ThreadSet& set, std::size_t k, Role role,
                       const std::vector<double>& heights_mm, double crossing_spacing_mm) {
  YarnCurve curve;
  curve.yarn = set.yarns[k];
  curve.radius_mm = set.radii_mm[k];
  curve.flattening = set.flattenings[k];
  curve.role = role;
  curve.period = role == Role::kWarp ? glm::ivec2(0, 1) : glm::ivec2(1, 0);
  const double across = (static_cast<double>(k) + 0.5) * set.spacing_mm;
  for (const glm::dvec2& at : crimp(heights_mm, crossing_spacing_mm)) {
    const glm::dvec3 centre =
        role == Role::kWarp ? glm::dvec3(across, at.x, at.y) : glm::dvec3(at.x, across, at.y);
    curve.nodes.push_back({centre, set.half_widths_mm[k], set.half_heights_mm[k]});
  }
  return curve;
}

}  // namespace

std::uint32_t yarn_index(const v1::FabricDescription& description, const std::string& name) {
  for (int y = 0; y < description.yarns_size(); ++y) {
    if (description.yarns(y).name() == name) {
      return static_cast<std::uint32_t>(y);
    }
  }
  throw core::Error(core::Code::kInvalidArgument,
                    "there is no yarn '" + name + "'; name one of the description's yarns");
}

YarnLayout lay_out_weave(const v1::FabricDescription& description) {
  const v1::Weave& weave = description.weave();
  const Draft draft = draft_of(weave);
  ThreadSet ends = thread_set(description, draft.end_yarns, "ends", weave.ends_per_cm());
  ThreadSet picks = thread_set(description, draft.pick_yarns, "picks", weave.picks_per_cm());
  press_sideways(ends, description);
  press_sideways(picks, description);
  const double share = warp_share(draft, ends, picks);

  YarnLayout layout;
  layout.size_mm = {draft.ends * ends.spacing_mm, draft.picks * picks.spacing_mm};
  std::vector<double> heights(draft.picks);
  for (std::uint32_t e = 0; e < draft.ends; ++e) {
    for (std::uint32_t p = 0; p < draft.picks; ++p) {
      const double sum = ends.half_heights_mm[e] + picks.half_heights_mm[p];
      heights[p] = (draft.warp_up(p, e) ? 1 : -1) * share * sum;
    }
    layout.curves.push_back(thread_curve(ends, e, Role::kWarp, heights, picks.spacing_mm));
  }
  heights.resize(draft.ends);
  for (std::uint32_t p = 0; p < draft.picks; ++p) {
    for (std::uint32_t e = 0; e < draft.ends; ++e) {
      const double sum = ends.half_heights_mm[e] + picks.half_heights_mm[p];
      heights[e] = (draft.warp_up(p, e) ? -1 : 1) * (1 - share) * sum;
    }
    layout.curves.push_back(thread_curve(picks, p, Role::kWeft, heights, ends.spacing_mm));
  }
  return layout;
}

}  // namespace weft::fabric
