#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/layout.h"
#include "fabric/relax.h"
#include "fabric/thread_path.h"

namespace weft::fabric {
namespace {

constexpr const char* kTwill = R"(rows: "XX.." rows: ".XX." rows: "..XX" rows: "X..X")";
constexpr const char* kSatin =
    R"(rows: ".XXXX" rows: "XXX.X" rows: "X.XXX" rows: "XXXX." rows: "XX.XX")";

v1::FabricDescription weave(const std::string& rows, double ends_per_cm, double picks_per_cm,
                            double flattening = 0.3) {
  const auto yarn = [flattening](const std::string& name, double radius_mm) {
    return "yarns { name: \"" + name +
           "\" material: \"m\" fibres_per_ply: 9 yarn_radius_mm: " + std::to_string(radius_mm) +
           " flattening: " + std::to_string(flattening) + " }\n";
  };
  return parse_description(
      "name: \"t\"\nweave { matrix { " + rows + " } ends_per_cm: " + std::to_string(ends_per_cm) +
          " picks_per_cm: " + std::to_string(picks_per_cm) +
          " warp_yarn: \"w\" weft_yarn: \"f\" }\n" + yarn("w", 0.1) + yarn("f", 0.12) +
          "materials { name: \"m\" c_r { r: 0.2 g: 0.2 b: 0.2 } c_tt { r: 0.5 g: 0.5 b: 0.5 } "
          "beta_r_deg: 10 beta_tt_deg: 20 gamma_tt_deg: 30 }\n",
      "test.textproto", ".");
}

// How far inside yarn `body` the point lies, as a share of its section: 0 on its surface, 1 on its
// axis, negative outside. Looks through all frames, without what the relaxation uses.
double depth_in(const std::vector<YarnFrame>& body, double radius_mm, glm::dvec3 point,
                glm::dvec2 size) {
  double depth = -1e300;
  for (const YarnFrame& frame : body) {
    glm::dvec3 away = point - frame.centre_mm;
    away.x -= std::nearbyint(away.x / size.x) * size.x;
    away.y -= std::nearbyint(away.y / size.y) * size.y;
    const glm::dvec3 tangent = glm::cross(frame.normal, frame.lateral);
    const double along = std::abs(glm::dot(away, tangent));
    if (along > 0.02 * radius_mm || glm::length(away) > 3 * radius_mm) {
      continue;
    }
    const double a = glm::dot(away, frame.lateral) / frame.lateral_scale;
    const double b = glm::dot(away, frame.normal) / frame.normal_scale;
    depth = std::max(depth, 1 - std::hypot(a, b) / radius_mm);
  }
  return depth;
}

// The deepest point of any yarn's surface in any other, measured on the finished paths.
double deepest_surface_point(const YarnLayout& layout) {
  constexpr int kAlong = 400;
  constexpr int kAround = 16;
  std::vector<std::vector<YarnFrame>> bodies;
  for (const YarnCurve& curve : layout.curves) {
    const ThreadPath path(curve, layout.size_mm);
    bodies.emplace_back();
    for (int k = 0; k < kAlong; ++k) {
      bodies.back().push_back(path.at(static_cast<double>(k) / kAlong));
    }
  }
  double deepest = 0;
  for (std::size_t u = 0; u < bodies.size(); ++u) {
    for (int k = 0; k < kAlong; k += 5) {
      for (int j = 0; j < kAround; ++j) {
        const double angle = 2 * std::numbers::pi * j / kAround;
        const double radius = layout.curves[u].radius_mm;
        const glm::dvec3 point = bodies[u][static_cast<std::size_t>(k)].place_mm(
            {radius * std::cos(angle), radius * std::sin(angle)});
        for (std::size_t v = 0; v < bodies.size(); ++v) {
          if (v != u) {
            deepest = std::max(
                deepest, depth_in(bodies[v], layout.curves[v].radius_mm, point, layout.size_mm));
          }
        }
      }
    }
  }
  return deepest;
}

TEST(Relax, LeavesNoYarnInsideAnother) {
  for (const auto& [rows, ends, picks] :
       {std::tuple(R"(rows: "X." rows: ".X")", 30.0, 30.0), std::tuple(kTwill, 40.0, 34.0),
        std::tuple(kSatin, 50.0, 30.0)}) {
    YarnLayout layout = lay_out(weave(rows, ends, picks));
    const double before = deepest_surface_point(layout);
    const RelaxReport report = relax(layout);
    EXPECT_LE(report.overlap_share, kOverlapTolerance) << rows;
    EXPECT_LE(deepest_overlap(layout), kOverlapTolerance) << rows;
    // The paths are smoother than the polygons that were relaxed, and sections differ in shape.
    EXPECT_LT(deepest_surface_point(layout), 3 * kOverlapTolerance) << rows;
    EXPECT_GT(before, 3 * kOverlapTolerance) << rows << ": there was nothing to relax";
  }
}

TEST(Relax, FlattensNoYarnBelowItsLimit) {
  YarnLayout layout = lay_out(weave(kTwill, 40, 34));
  (void)relax(layout);
  double flattest = 1;
  for (const YarnCurve& curve : layout.curves) {
    for (const YarnNode& node : curve.nodes) {
      flattest = std::min(
          {flattest, node.half_height_mm / curve.radius_mm, node.half_width_mm / curve.radius_mm});
    }
  }
  EXPECT_GE(flattest, 0.7 - 1e-9);
  EXPECT_LT(flattest, 0.95) << "nothing was pressed";
}

TEST(Relax, KeepsWhoLiesOnTop) {
  YarnLayout layout = lay_out(weave(kSatin, 50, 30));
  const YarnLayout before = layout;
  (void)relax(layout);
  // Eight nodes from crossing to crossing: every eighth node of an end is at a pick.
  for (std::size_t end = 0; end < 5; ++end) {
    for (std::size_t pick = 0; pick < 5; ++pick) {
      const auto gap = [&](const YarnLayout& at) {
        return at.curves[end].nodes[8 * pick].centre_mm.z -
               at.curves[5 + pick].nodes[8 * end].centre_mm.z;
      };
      EXPECT_GT(gap(before) * gap(layout), 0);
      EXPECT_GT(std::abs(gap(layout)), 0.7 * (0.1 + 0.12) * 0.9);
    }
  }
}

TEST(Relax, TreatsFaceAndBackOfATwillAlike) {
  YarnLayout layout = lay_out(weave(kTwill, 40, 34));
  (void)relax(layout);
  double low = 0;
  double high = 0;
  for (const YarnCurve& curve : layout.curves) {
    for (const YarnNode& node : curve.nodes) {
      low = std::min(low, node.centre_mm.z);
      high = std::max(high, node.centre_mm.z);
    }
  }
  EXPECT_NEAR(low, -high, 0.01 * high);
}

TEST(Relax, RefusesAJammedClothWithNumbers) {
  try {
    (void)build_tile(weave(R"(rows: "X." rows: ".X")", 47, 40, 0.02));
    FAIL() << "was not refused";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    EXPECT_NE(std::string(error.what()).find("overlap by"), std::string::npos) << error.what();
  }
}

TEST(Relax, LeavesCirclesThatDoNotTouchAlone) {
  YarnLayout layout = lay_out(weave(R"(rows: "X")", 10, 10));
  EXPECT_LT(deepest_overlap(layout), 1e-9);
  (void)relax(layout);
  EXPECT_LT(deepest_overlap(layout), 1e-9);
}

TEST(RepeatLayout, JoinsCurvesThatContinueEachOther) {
  YarnLayout layout;
  layout.size_mm = {1, 2};
  YarnCurve curve;
  curve.period = {1, 1};
  curve.nodes = {{{0, 0, 0}, 1, 1}, {{0.3, 0.6, 0}, 1, 1}, {{0.6, 1.2, 0}, 1, 1}};
  layout.curves = {curve};
  const YarnLayout larger = repeat_layout(layout, {2, 4});
  ASSERT_EQ(larger.curves.size(), 2U);
  for (const YarnCurve& joined : larger.curves) {
    EXPECT_EQ(joined.nodes.size(), 4 * curve.nodes.size());
    EXPECT_EQ(joined.period, glm::ivec2(2, 1));
    EXPECT_NEAR(length_mm(joined, larger.size_mm), 4 * length_mm(curve, layout.size_mm), 1e-12);
  }
}

}  // namespace
}  // namespace weft::fabric
