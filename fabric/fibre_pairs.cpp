#include "fabric/fibre_pairs.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <glm/geometric.hpp>

#include "fabric/fibres.h"

namespace weft::fabric {

namespace {

// A cell is no smaller than what a piece reaches; a tile never has more cells than this each way.
constexpr int kMostCells = 512;
constexpr float kRounding = 1.0001F;  // reaches are compared in single precision first
constexpr double kShortest2 = 1e-24;  // squared length below which a piece is a point

// Pieces by the cell of their midpoint, wrapped into the tile, in counting order.
class PieceGrid {
  // What the search reads of a piece, side by side by cell.
  struct Member {
    glm::vec3 middle_mm;
    float reach_mm = 0;
    std::uint32_t piece = 0;
  };

 public:
  PieceGrid(const FibreBody& body, double margin_mm) : body_(body), margin_mm_(margin_mm) {
    measure();
    const std::size_t count = body.pieces.size();
    std::vector<std::uint32_t> cell_of(count);
    starts_.assign(std::size_t{index(cells_ - 1)} + 2, 0);
    for (std::size_t k = 0; k < count; ++k) {
      cell_of[k] = index(cell_at(wrapped_[k]));
      ++starts_[cell_of[k] + 1];
    }
    std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
    members_.resize(count);
    std::vector<std::uint32_t> next(starts_.begin(), starts_.end() - 1);
    for (std::uint32_t k = 0; k < count; ++k) {
      members_[next[cell_of[k]]++] = {glm::vec3(wrapped_[k]), static_cast<float>(reaches_[k]), k};
    }
  }

  void collect(std::uint32_t u, std::vector<FibrePair>& pairs) const {
    const glm::ivec3 home = cell_at(wrapped_[u]);
    for (int dx = -around_.x; dx <= around_.x; ++dx) {
      for (int dy = -around_.y; dy <= around_.y; ++dy) {
        const glm::ivec2 wrap = {floor_divide(home.x + dx, cells_.x),
                                 floor_divide(home.y + dy, cells_.y)};
        const glm::ivec2 at = {home.x + dx - wrap.x * cells_.x, home.y + dy - wrap.y * cells_.y};
        for (int z = std::max(0, home.z - 1); z <= std::min(cells_.z - 1, home.z + 1); ++z) {
          collect_from(u, {at.x, at.y, z}, wrap, pairs);
        }
      }
    }
  }

 private:
  static int floor_divide(int a, int b) { return a >= 0 ? a / b : -((b - 1 - a) / b); }

  void measure() {
    double reach = 0;
    double low = 1e300;
    double high = -1e300;
    for (const FibreBody::Piece& piece : body_.pieces) {
      const glm::dvec3 a = body_.begin_mm(piece);
      const glm::dvec3 b = body_.end_mm(piece);
      const glm::dvec3 middle = 0.5 * (a + b);
      const glm::ivec2 tile = {static_cast<int>(std::floor(middle.x / body_.size_mm.x)),
                               static_cast<int>(std::floor(middle.y / body_.size_mm.y))};
      tiles_.push_back(tile);
      wrapped_.emplace_back(middle.x - tile.x * body_.size_mm.x,
                            middle.y - tile.y * body_.size_mm.y, middle.z);
      reaches_.push_back(0.5 * glm::distance(a, b) + piece.radius_mm + 0.5 * margin_mm_);
      reach = std::max(reach, reaches_.back());
      low = std::min(low, middle.z);
      high = std::max(high, middle.z);
    }
    const double side = 2 * reach;
    const auto cells_in = [side](double length) {
      return std::clamp(static_cast<int>(length / side), 1, kMostCells);
    };
    low_mm_ = low;
    cells_ = {cells_in(body_.size_mm.x), cells_in(body_.size_mm.y), cells_in(high - low)};
    cell_mm_ = {body_.size_mm.x / cells_.x, body_.size_mm.y / cells_.y,
                std::max((high - low) / cells_.z, side)};
    around_ = {static_cast<int>(std::ceil(side / cell_mm_.x)),
               static_cast<int>(std::ceil(side / cell_mm_.y))};
  }

  [[nodiscard]] glm::ivec3 cell_at(glm::dvec3 place) const {
    const auto cell = [](double distance, double side, int count) {
      return std::clamp(static_cast<int>(std::floor(distance / side)), 0, count - 1);
    };
    return {cell(place.x, cell_mm_.x, cells_.x), cell(place.y, cell_mm_.y, cells_.y),
            cell(place.z - low_mm_, cell_mm_.z, cells_.z)};
  }

  [[nodiscard]] std::uint32_t index(glm::ivec3 cell) const {
    return static_cast<std::uint32_t>((cell.z * cells_.y + cell.y) * cells_.x + cell.x);
  }

  // `wrap` is how many tiles away the cell's copy lies, between wrapped midpoints.
  void collect_from(std::uint32_t u, glm::ivec3 cell, glm::ivec2 wrap,
                    std::vector<FibrePair>& pairs) const {
    const std::uint32_t c = index(cell);
    const glm::vec3 from(wrapped_[u] -
                         glm::dvec3(wrap.x * body_.size_mm.x, wrap.y * body_.size_mm.y, 0));
    const auto own_reach = static_cast<float>(reaches_[u]);
    // The same pair is found from the other side: only pieces from u on, which a cell has in order.
    std::uint32_t m = starts_[c];
    while (m < starts_[c + 1] && members_[m].piece < u) {
      ++m;
    }
    for (; m < starts_[c + 1]; ++m) {
      const glm::vec3 step = members_[m].middle_mm - from;
      const float reach = (members_[m].reach_mm + own_reach) * kRounding;
      if (glm::dot(step, step) >= reach * reach) {
        continue;
      }
      const std::uint32_t v = members_[m].piece;
      if (v == u && (wrap.x < 0 || (wrap.x == 0 && wrap.y <= 0))) {
        continue;
      }
      const FibrePair pair{u, v, wrap + tiles_[u] - tiles_[v]};
      if (same_fibre(pair)) {
        continue;
      }
      const double near = body_.pieces[u].radius_mm + body_.pieces[v].radius_mm + margin_mm_;
      const glm::dvec3 gap = approach_of(body_, pair).gap_mm;
      if (glm::dot(gap, gap) < near * near) {
        pairs.push_back(pair);
      }
    }
  }

  [[nodiscard]] bool same_fibre(const FibrePair& pair) const {
    const std::uint32_t strand = body_.pieces[pair.u].strand;
    if (strand != body_.pieces[pair.v].strand) {
      return false;
    }
    // A whole multiple of the period: parallel to it, and divisible by it.
    const glm::ivec2 period = body_.strand_periods[strand];
    const glm::ivec2 copy = pair.copy;
    if (copy.x * period.y != copy.y * period.x) {
      return false;
    }
    return (period.x == 0 ? copy.x == 0 : copy.x % period.x == 0) &&
           (period.y == 0 ? copy.y == 0 : copy.y % period.y == 0);
  }

  const FibreBody& body_;
  double margin_mm_;
  double low_mm_ = 0;
  glm::ivec3 cells_{1};
  glm::dvec3 cell_mm_{0};
  glm::ivec2 around_{1};
  std::vector<glm::ivec2> tiles_;    // [piece]: the tile that its midpoint lies in
  std::vector<glm::dvec3> wrapped_;  // [piece]: its midpoint, moved into the first tile
  std::vector<double> reaches_;      // [piece]: from its midpoint, half the margin included
  std::vector<std::uint32_t> starts_;
  std::vector<Member> members_;
};

}  // namespace

FibreBody::FibreBody(const Tile& tile) : size_mm(tile.size_mm) {
  for (std::uint32_t s = 0; s < tile.strands.size(); ++s) {
    const Strand& strand = tile.strands[s];
    const bool periodic = strand.period_x != 0 || strand.period_y != 0;
    const auto first = static_cast<std::uint32_t>(nodes_mm.size());
    const std::uint32_t count = strand.point_count - (periodic ? 1 : 0);
    strand_periods.emplace_back(strand.period_x, strand.period_y);
    first_nodes.push_back(first);
    for (std::uint32_t p = 0; p < count; ++p) {
      nodes_mm.emplace_back(tile.points_mm[strand.first_point + p]);
    }
    for (std::uint32_t p = 0; p + 1 < strand.point_count; ++p) {
      const bool closes = p + 1 == count;
      Piece piece{first + p, closes ? first : first + p + 1, s,
                  static_cast<double>(strand.radius_mm), glm::dvec3(0)};
      if (closes) {
        piece.shift_mm = {strand.period_x * size_mm.x, strand.period_y * size_mm.y, 0};
      }
      pieces.push_back(piece);
    }
  }
  first_nodes.push_back(static_cast<std::uint32_t>(nodes_mm.size()));
}

void FibreBody::write_to(Tile& tile) const {
  for (std::size_t s = 0; s < tile.strands.size(); ++s) {
    const Strand& strand = tile.strands[s];
    const std::uint32_t count = first_nodes[s + 1] - first_nodes[s];
    for (std::uint32_t p = 0; p < count; ++p) {
      tile.points_mm[strand.first_point + p] = glm::vec3(nodes_mm[first_nodes[s] + p]);
    }
    if (count < strand.point_count) {
      tile.points_mm[strand.first_point + count] =
          period_end(tile.points_mm[strand.first_point], strand_periods[s], tile.size_mm);
    }
  }
}

// Ericson, Real-Time Collision Detection (2005), section 5.1.9.
Approach approach_of(const FibreBody& body, const FibrePair& pair) {
  const FibreBody::Piece& u = body.pieces[pair.u];
  const FibreBody::Piece& v = body.pieces[pair.v];
  const glm::dvec3 p = body.begin_mm(u);
  const glm::dvec3 q =
      body.begin_mm(v) + glm::dvec3(pair.copy.x * body.size_mm.x, pair.copy.y * body.size_mm.y, 0);
  const glm::dvec3 along_u = body.end_mm(u) - p;
  const glm::dvec3 along_v = body.end_mm(v) - body.begin_mm(v);
  const glm::dvec3 between = p - q;
  const double uu = std::max(glm::dot(along_u, along_u), kShortest2);
  const double vv = std::max(glm::dot(along_v, along_v), kShortest2);
  const double uv = glm::dot(along_u, along_v);
  const double ub = glm::dot(along_u, between);
  const double vb = glm::dot(along_v, between);
  const double denominator = uu * vv - uv * uv;
  Approach approach;
  if (denominator > 1e-12 * uu * vv) {
    approach.at_u = std::clamp((uv * vb - ub * vv) / denominator, 0.0, 1.0);
  } else {
    approach.at_u = 0.5;  // parallel: any place is as close, the middle moves both ends
  }
  approach.at_v = (uv * approach.at_u + vb) / vv;
  if (approach.at_v < 0 || approach.at_v > 1) {
    approach.at_v = std::clamp(approach.at_v, 0.0, 1.0);
    approach.at_u = std::clamp((uv * approach.at_v - ub) / uu, 0.0, 1.0);
  }
  approach.gap_mm = q + along_v * approach.at_v - p - along_u * approach.at_u;
  return approach;
}

std::vector<FibrePair> close_pairs(const FibreBody& body, double margin_mm) {
  std::vector<FibrePair> pairs;
  if (body.pieces.empty()) {
    return pairs;
  }
  const PieceGrid grid(body, margin_mm);
  for (std::uint32_t u = 0; u < body.pieces.size(); ++u) {
    grid.collect(u, pairs);
  }
  return pairs;
}

}  // namespace weft::fabric
