#include "fabric/yarn_contact.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include "core/check.h"

namespace weft::fabric {

namespace {

// Pieces of one curve nearer along it than this many radii are neighbours, not contacts.
constexpr double kOwnRadii = 4;
constexpr double kTiny = 1e-12;
// Pieces whose directions have at least this cosine lie side by side; others cross.
constexpr double kSideBySide = 0.9;
// Added to the shape matrices' diagonal, as a share of their trace, so that they can be inverted.
constexpr double kLeastShape = 1e-3;

double widest(const YarnBody& body, std::uint32_t node) {
  return std::max(body.half_widths_mm[node], body.half_heights_mm[node]);
}

// A piece's middle and how far from it anything of it can be.
struct Ball {
  glm::dvec3 middle_mm{0};
  double radius_mm = 0;
};

Ball ball_of(const YarnBody& body, std::uint32_t u) {
  const YarnBody::Neighbour next = body.neighbour(u, 1);
  const glm::dvec3 a = body.centres_mm[u];
  const glm::dvec3 b = body.centres_mm[next.node] + next.shift_mm;
  return {0.5 * (a + b),
          0.5 * glm::distance(a, b) + std::max(widest(body, u), widest(body, next.node))};
}

// A copy of a piece that may touch something in the tile at the origin.
struct Copy {
  std::uint32_t piece = 0;
  glm::ivec2 tile{0};
};

struct Grid {
  glm::dvec2 low_mm{0};
  double cell_mm = 1;
  glm::ivec2 cells{1};
  std::vector<std::vector<Copy>> copies;  // [cells.y, cells.x]

  [[nodiscard]] std::size_t slot(glm::ivec2 cell) const {
    return static_cast<std::size_t>(cell.y) * static_cast<std::size_t>(cells.x) +
           static_cast<std::size_t>(cell.x);
  }

  [[nodiscard]] glm::ivec2 cell_of(glm::dvec3 at) const {
    const glm::ivec2 cell{static_cast<int>(std::floor((at.x - low_mm.x) / cell_mm)),
                          static_cast<int>(std::floor((at.y - low_mm.y) / cell_mm))};
    return {std::clamp(cell.x, 0, cells.x - 1), std::clamp(cell.y, 0, cells.y - 1)};
  }
};

glm::ivec2 tile_of(glm::dvec3 at, glm::dvec2 size) {
  return {static_cast<int>(std::floor(at.x / size.x)), static_cast<int>(std::floor(at.y / size.y))};
}

Grid fill_grid(const std::vector<Ball>& balls, glm::dvec2 size, double range_mm) {
  Grid grid;
  grid.low_mm = glm::dvec2(-range_mm);
  grid.cell_mm = std::max(range_mm, std::max(size.x, size.y) / 1024);
  grid.cells = glm::ivec2((size + 2 * range_mm) / grid.cell_mm) + 1;
  grid.copies.resize(static_cast<std::size_t>(grid.cells.x) *
                     static_cast<std::size_t>(grid.cells.y));
  for (std::size_t v = 0; v < balls.size(); ++v) {
    const glm::dvec3 at = balls[v].middle_mm;
    const glm::ivec2 from = tile_of({-range_mm - at.x, -range_mm - at.y, 0}, size) + 1;
    const glm::ivec2 to = tile_of({size.x + range_mm - at.x, size.y + range_mm - at.y, 0}, size);
    for (int j = from.y; j <= to.y; ++j) {
      for (int i = from.x; i <= to.x; ++i) {
        const glm::ivec2 cell = grid.cell_of(at + glm::dvec3(i * size.x, j * size.y, 0));
        grid.copies[grid.slot(cell)].push_back({static_cast<std::uint32_t>(v), {i, j}});
      }
    }
  }
  return grid;
}

// Whether piece v in tile `copy` (u being in tile 0, 0) is joined to u by a short piece of yarn.
bool joined(const YarnBody& body, std::uint32_t u, std::uint32_t v, glm::ivec2 copy) {
  if (body.curve_of[u] != body.curve_of[v]) {
    return false;
  }
  const YarnBody::Curve& curve = body.curves[body.curve_of[u]];
  int turns = 0;
  if (curve.period.x != 0) {
    turns = copy.x / curve.period.x;
  } else if (curve.period.y != 0) {
    turns = copy.y / curve.period.y;
  }
  if (copy != curve.period * turns) {
    return false;
  }
  auto apart = static_cast<double>(v) - static_cast<double>(u);
  const auto count = static_cast<double>(curve.count);
  if (curve.period == glm::ivec2(0, 0)) {
    apart -= std::nearbyint(apart / count) * count;  // a ring: the shorter way
  }
  return std::abs(apart + turns * count) * curve.spacing_mm < kOwnRadii * curve.radius_mm;
}

// Ericson, Real-Time Collision Detection (2005), section 5.1.9.
void closest_shares(glm::dvec3 p, glm::dvec3 d, glm::dvec3 q, glm::dvec3 e, double& s, double& t) {
  const glm::dvec3 r = p - q;
  const double dd = std::max(glm::dot(d, d), kTiny);
  const double ee = std::max(glm::dot(e, e), kTiny);
  const double er = glm::dot(e, r);
  const double dr = glm::dot(d, r);
  const double de = glm::dot(d, e);
  const double denominator = dd * ee - de * de;
  s = denominator > kTiny * dd * ee ? std::clamp((de * er - dr * ee) / denominator, 0.0, 1.0) : 0.5;
  t = (de * s + er) / ee;
  if (t < 0 || t > 1) {
    t = std::clamp(t, 0.0, 1.0);
    s = std::clamp((de * t - dr) / dd, 0.0, 1.0);
  }
}

struct Section {
  glm::dvec3 lateral;  // times the half width
  glm::dvec3 normal;   // times the half height
  [[nodiscard]] double reach(glm::dvec3 n) const {
    const double a = glm::dot(lateral, n);
    const double b = glm::dot(normal, n);
    return std::sqrt(a * a + b * b);
  }
};

Section section_at(const YarnBody& body, std::uint32_t from, std::uint32_t to, double f) {
  const double width = body.half_widths_mm[from] * (1 - f) + body.half_widths_mm[to] * f;
  const double height = body.half_heights_mm[from] * (1 - f) + body.half_heights_mm[to] * f;
  return {(body.laterals[from] * (1 - f) + body.laterals[to] * f) * width,
          (body.normals[from] * (1 - f) + body.normals[to] * f) * height};
}

// Two ellipses of one shape, side by side, are apart along M^-1 d, M the sum of their shape
// matrices; across the yarns' common direction.
glm::dvec3 stretched_normal(const Section& u, const Section& v, glm::dvec3 d, glm::dvec3 along) {
  glm::dmat3 shape(0);
  double trace = 0;
  for (const glm::dvec3& axis : {u.lateral, u.normal, v.lateral, v.normal}) {
    shape += glm::outerProduct(axis, axis);
    trace += glm::dot(axis, axis);
  }
  for (int k = 0; k < 3; ++k) {
    shape[k][k] += kLeastShape * trace;
  }
  glm::dvec3 n = glm::inverse(shape) * d;
  n -= along * glm::dot(n, along);
  return n / std::max(glm::length(n), kTiny);
}

}  // namespace

YarnBody::YarnBody(const YarnLayout& layout) : size_mm(layout.size_mm) {
  for (const YarnCurve& curve : layout.curves) {
    curves.push_back({static_cast<std::uint32_t>(centres_mm.size()),
                      static_cast<std::uint32_t>(curve.nodes.size()),
                      fabric::period_mm(curve, layout.size_mm), curve.period,
                      length_mm(curve, layout.size_mm) / static_cast<double>(curve.nodes.size()),
                      curve.radius_mm, curve.flattening, curve.role});
    for (const YarnNode& node : curve.nodes) {
      curve_of.push_back(static_cast<std::uint32_t>(curves.size() - 1));
      centres_mm.push_back(node.centre_mm);
      half_widths_mm.push_back(node.half_width_mm);
      half_heights_mm.push_back(node.half_height_mm);
    }
  }
  laterals.resize(centres_mm.size());
  normals.resize(centres_mm.size());
  update_frames();
}

YarnBody::Neighbour YarnBody::neighbour(std::uint32_t node, int steps) const {
  const Curve& curve = curves[curve_of[node]];
  const auto count = static_cast<int>(curve.count);
  int at = static_cast<int>(node - curve.first) + steps;
  glm::dvec3 shift{0};
  for (; at >= count; at -= count) {
    shift += curve.period_mm;
  }
  for (; at < 0; at += count) {
    shift -= curve.period_mm;
  }
  return {curve.first + static_cast<std::uint32_t>(at), shift};
}

void YarnBody::update_frames() {
  for (std::uint32_t n = 0; n < centres_mm.size(); ++n) {
    const Role role = curves[curve_of[n]].role;
    const Neighbour before = neighbour(n, -1);
    const Neighbour after = neighbour(n, 1);
    const glm::dvec3 step =
        centres_mm[after.node] + after.shift_mm - centres_mm[before.node] - before.shift_mm;
    const glm::dvec3 tangent = step / std::max(glm::length(step), kTiny);
    // Curves that are neither warp nor weft stay circular: any frame across them will do.
    glm::dvec3 reference{1, 0, 0};
    if (role == Role::kWeft) {
      reference = {0, -1, 0};
    } else if (role != Role::kWarp && std::abs(tangent.x) > 0.7) {
      reference = {0, 1, 0};
    }
    const glm::dvec3 across = reference - tangent * glm::dot(reference, tangent);
    laterals[n] = across / std::max(glm::length(across), kTiny);
    normals[n] = glm::cross(laterals[n], tangent);
  }
}

void YarnBody::write_to(YarnLayout& layout) const {
  CHECK_EQ(layout.curves.size(), curves.size());
  std::size_t n = 0;
  for (YarnCurve& curve : layout.curves) {
    for (YarnNode& node : curve.nodes) {
      node = {centres_mm[n], half_widths_mm[n], half_heights_mm[n]};
      ++n;
    }
  }
}

std::vector<NearPair> near_pairs(const YarnBody& body, double margin_mm) {
  std::vector<Ball> balls;
  double largest = 0;
  for (std::uint32_t u = 0; u < body.centres_mm.size(); ++u) {
    balls.push_back(ball_of(body, u));
    largest = std::max(largest, balls.back().radius_mm);
  }
  const Grid grid = fill_grid(balls, body.size_mm, 2 * largest + margin_mm);
  std::vector<NearPair> pairs;
  for (std::uint32_t u = 0; u < balls.size(); ++u) {
    const glm::ivec2 home = tile_of(balls[u].middle_mm, body.size_mm);
    const glm::dvec3 to_home{home.x * body.size_mm.x, home.y * body.size_mm.y, 0};
    const glm::ivec2 cell = grid.cell_of(balls[u].middle_mm - to_home);
    const auto add = [&](const Copy& copy) {
      const std::uint32_t v = copy.piece;
      const glm::ivec2 tile = copy.tile + home;
      if (v < u || (v == u && (tile.y < 0 || (tile.y == 0 && tile.x <= 0)))) {
        return;  // the same pair, seen from its other end
      }
      const glm::dvec3 shift{tile.x * body.size_mm.x, tile.y * body.size_mm.y, 0};
      const double reach = balls[u].radius_mm + balls[v].radius_mm + margin_mm;
      const glm::dvec3 apart = balls[v].middle_mm + shift - balls[u].middle_mm;
      if (glm::dot(apart, apart) <= reach * reach && !joined(body, u, v, tile)) {
        pairs.push_back({u, v, shift});
      }
    };
    for (int cy = std::max(0, cell.y - 1); cy <= std::min(grid.cells.y - 1, cell.y + 1); ++cy) {
      for (int cx = std::max(0, cell.x - 1); cx <= std::min(grid.cells.x - 1, cell.x + 1); ++cx) {
        const std::vector<Copy>& copies = grid.copies[grid.slot({cx, cy})];
        std::for_each(copies.begin(), copies.end(), add);
      }
    }
  }
  return pairs;
}

Contact contact_of(const YarnBody& body, const NearPair& pair) {
  const YarnBody::Neighbour u_next = body.neighbour(pair.u, 1);
  const YarnBody::Neighbour v_next = body.neighbour(pair.v, 1);
  const glm::dvec3 p = body.centres_mm[pair.u];
  const glm::dvec3 q = body.centres_mm[pair.v] + pair.shift_mm;
  const glm::dvec3 along_u = body.centres_mm[u_next.node] + u_next.shift_mm - p;
  const glm::dvec3 along_v = body.centres_mm[v_next.node] + v_next.shift_mm + pair.shift_mm - q;
  Contact contact;
  closest_shares(p, along_u, q, along_v, contact.at_u, contact.at_v);
  const glm::dvec3 d = q + along_v * contact.at_v - p - along_u * contact.at_u;
  const double distance = glm::length(d);
  const double most = std::max(widest(body, pair.u), widest(body, u_next.node)) +
                      std::max(widest(body, pair.v), widest(body, v_next.node));
  if (distance >= most) {
    contact.overlap_mm = most - distance;
    contact.normal = d / distance;
    return contact;
  }
  const Section u = section_at(body, pair.u, u_next.node, contact.at_u);
  const Section v = section_at(body, pair.v, v_next.node, contact.at_v);
  contact.normal = distance > kTiny ? d / distance : glm::dvec3(0, 0, 1);
  contact.overlap_mm = u.reach(contact.normal) + v.reach(contact.normal) - distance;
  const glm::dvec3 unit_u = along_u / std::max(glm::length(along_u), kTiny);
  const glm::dvec3 unit_v = along_v / std::max(glm::length(along_v), kTiny);
  const double cosine = glm::dot(unit_u, unit_v);
  if (contact.overlap_mm > 0 && distance > kTiny && std::abs(cosine) > kSideBySide) {
    const glm::dvec3 sum = unit_u + unit_v * (cosine < 0 ? -1.0 : 1.0);
    const glm::dvec3 n = stretched_normal(u, v, d, sum / glm::length(sum));
    const double overlap = u.reach(n) + v.reach(n) - glm::dot(n, d);
    if (overlap < contact.overlap_mm) {
      contact.overlap_mm = overlap;
      contact.normal = n;
    }
  }
  return contact;
}

}  // namespace weft::fabric
