#include "fabric/fibre_pairs.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include <glm/geometric.hpp>

namespace weft::fabric {

namespace {

// A cell is no smaller than what a piece reaches; a tile never has more cells than this each way.
constexpr int kMostCells = 512;
constexpr float kRounding = 1.0001F;  // reaches are compared in single precision first
constexpr double kShortest2 = 1e-24;  // squared length below which a piece is a point

double clamped(double share) { return std::min(std::max(share, 0.0), 1.0); }

// What the search reads of pieces, side by side by cell.
struct Members {
  std::vector<float> x_mm;  // of the middle
  std::vector<float> y_mm;
  std::vector<float> z_mm;
  std::vector<float> reach_mm;
  std::vector<std::uint32_t> piece;

  void resize(std::size_t count) {
    for (std::vector<float>* const values : {&x_mm, &y_mm, &z_mm, &reach_mm}) {
      values->resize(count);
    }
    piece.resize(count);
  }
  void set(std::uint32_t m, std::uint32_t of_piece, glm::vec3 middle, float reach) {
    x_mm[m] = middle.x;
    y_mm[m] = middle.y;
    z_mm[m] = middle.z;
    reach_mm[m] = reach;
    piece[m] = of_piece;
  }
  [[nodiscard]] glm::vec3 middle_mm(std::uint32_t m) const { return {x_mm[m], y_mm[m], z_mm[m]}; }

  // Whether each from `first` to before `end` may reach who stands at `at`: one byte each.
  void measure(glm::vec3 at, float own_reach, std::uint32_t first, std::uint32_t end,
               std::uint8_t* near) const {
    const float* const xs = x_mm.data() + first;
    const float* const ys = y_mm.data() + first;
    const float* const zs = z_mm.data() + first;
    const float* const reaches = reach_mm.data() + first;
    for (std::uint32_t m = 0; m < end - first; ++m) {
      const float x = xs[m] - at.x;
      const float y = ys[m] - at.y;
      const float z = zs[m] - at.z;
      const float reach = (reaches[m] + own_reach) * kRounding;
      near[m] = x * x + y * y + z * z < reach * reach ? 1 : 0;
    }
  }
};

// Pieces by the cell of their midpoint, wrapped into the tile, in counting order.
class PieceGrid {
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
      members_.set(next[cell_of[k]]++, k, glm::vec3(wrapped_[k]), static_cast<float>(reaches_[k]));
    }
  }

  [[nodiscard]] const FibreBody& body() const { return body_; }
  [[nodiscard]] double margin_mm() const { return margin_mm_; }
  [[nodiscard]] glm::ivec3 cells() const { return cells_; }
  [[nodiscard]] glm::ivec2 around() const { return around_; }  // cells that a piece reaches into
  [[nodiscard]] const Members& members() const { return members_; }
  [[nodiscard]] glm::ivec2 tile_of(std::uint32_t piece) const { return tiles_[piece]; }
  [[nodiscard]] std::uint32_t index(glm::ivec3 cell) const {
    return static_cast<std::uint32_t>((cell.z * cells_.y + cell.y) * cells_.x + cell.x);
  }
  // The first member of a cell; that of the next one is behind its last.
  [[nodiscard]] std::uint32_t start(std::uint32_t cell) const { return starts_[cell]; }

 private:
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
  Members members_;
};

// The pairs of one row of cells with all that lie behind it: of the pairs of cells that may hold
// pairs of pieces one half is visited, the other half are the same ones from their other end.
class RowPairs {
 public:
  explicit RowPairs(const PieceGrid& grid) : grid_(grid) {}

  [[nodiscard]] std::vector<FibrePair> collect(int y, int z) {
    std::vector<FibrePair> pairs;
    for (int x = 0; x < grid_.cells().x; ++x) {
      collect_round({x, y, z}, pairs);
    }
    keep_candidates(pairs);
    return pairs;
  }

 private:
  static int floor_divide(int a, int b) { return a >= 0 ? a / b : -((b - 1 - a) / b); }

  // The pairs of `home` with itself and with the cells behind it, by z, then y, then x.
  void collect_round(glm::ivec3 home, std::vector<FibrePair>& pairs) {
    const std::uint32_t c = grid_.index(home);
    const glm::ivec2 around = grid_.around();
    for (std::uint32_t m = grid_.start(c); m < grid_.start(c + 1); ++m) {
      collect_from(m, m + 1, grid_.start(c + 1), {0, 0}, pairs);
    }
    collect_row(home, home, {home.x + 1, home.x + around.x}, pairs);
    for (int dy = 1; dy <= around.y; ++dy) {
      collect_row(home, {home.x, home.y + dy, home.z}, {home.x - around.x, home.x + around.x},
                  pairs);
    }
    for (int dy = -around.y; home.z + 1 < grid_.cells().z && dy <= around.y; ++dy) {
      collect_row(home, {home.x, home.y + dy, home.z + 1}, {home.x - around.x, home.x + around.x},
                  pairs);
    }
  }

  // The pairs of `home` with cells first to last of a row of cells; those beyond the tile's borders
  // are copies. Members of neighbours in a row lie side by side.
  void collect_row(glm::ivec3 home, glm::ivec3 row, glm::ivec2 first_and_last,
                   std::vector<FibrePair>& pairs) {
    const std::uint32_t c = grid_.index(home);
    const glm::ivec3 cells = grid_.cells();
    const int wrap_y = floor_divide(row.y, cells.y);
    const int y = row.y - wrap_y * cells.y;
    for (int x = first_and_last.x; x <= first_and_last.y;) {
      const int wrap_x = floor_divide(x, cells.x);
      const int last = std::min(first_and_last.y, (wrap_x + 1) * cells.x - 1);
      const std::uint32_t first_member = grid_.start(grid_.index({x - wrap_x * cells.x, y, row.z}));
      const std::uint32_t end = grid_.start(grid_.index({last - wrap_x * cells.x, y, row.z}) + 1);
      for (std::uint32_t m = grid_.start(c); m < grid_.start(c + 1); ++m) {
        collect_from(m, first_member, end, {wrap_x, wrap_y}, pairs);
      }
      x = last + 1;
    }
  }

  // The pairs of one member with those from `first` to before `end`, whose cells' copy lies `wrap`
  // tiles away.
  void collect_from(std::uint32_t member, std::uint32_t first, std::uint32_t end, glm::ivec2 wrap,
                    std::vector<FibrePair>& pairs) {
    const Members& members = grid_.members();
    const FibreBody& body = grid_.body();
    const glm::vec3 at =
        members.middle_mm(member) - glm::vec3(static_cast<float>(wrap.x * body.size_mm.x),
                                              static_cast<float>(wrap.y * body.size_mm.y), 0);
    near_.resize(std::max<std::size_t>(near_.size(), end - first + sizeof(std::uint64_t)));
    members.measure(at, members.reach_mm[member], first, end, near_.data());
    std::fill_n(near_.begin() + (end - first), sizeof(std::uint64_t), std::uint8_t{0});
    for (std::uint32_t m = first; m < end; m += sizeof(std::uint64_t)) {
      std::uint64_t eight = 0;
      std::memcpy(&eight, near_.data() + (m - first), sizeof eight);
      for (; eight != 0; eight &= eight - 1) {
        const auto byte = static_cast<std::uint32_t>(std::countr_zero(eight)) / 8;
        keep_if_close(members.piece[member], members.piece[m + byte], wrap, pairs);
      }
    }
  }

  void keep_if_close(std::uint32_t u, std::uint32_t v, glm::ivec2 wrap,
                     std::vector<FibrePair>& pairs) {
    const FibrePair pair{u, v, wrap + grid_.tile_of(u) - grid_.tile_of(v)};
    if (same_fibre(pair)) {
      return;
    }
    candidates_.push_back(pair);
    if (candidates_.size() == Approaches::kCount) {
      keep_candidates(pairs);
    }
  }

  void keep_candidates(std::vector<FibrePair>& pairs) {
    const FibreBody& body = grid_.body();
    approaches_.measure(body, candidates_);
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      const FibrePair& pair = candidates_[i];
      const double near =
          body.pieces[pair.u].radius_mm + body.pieces[pair.v].radius_mm + grid_.margin_mm();
      if (approaches_.gap2(i) < near * near) {
        pairs.push_back(pair);
      }
    }
    candidates_.clear();
  }

  [[nodiscard]] bool same_fibre(const FibrePair& pair) const {
    const FibreBody& body = grid_.body();
    const std::uint32_t strand = body.pieces[pair.u].strand;
    if (strand != body.pieces[pair.v].strand) {
      return false;
    }
    // A whole multiple of the period: parallel to it, and divisible by it.
    const glm::ivec2 period = body.strand_periods[strand];
    const glm::ivec2 copy = pair.copy;
    if (copy.x * period.y != copy.y * period.x) {
      return false;
    }
    return (period.x == 0 ? copy.x == 0 : copy.x % period.x == 0) &&
           (period.y == 0 ? copy.y == 0 : copy.y % period.y == 0);
  }

  const PieceGrid& grid_;
  std::vector<std::uint8_t> near_;     // scratch
  std::vector<FibrePair> candidates_;  // scratch, at most Approaches::kCount
  Approaches approaches_;
};

}  // namespace

// Ericson, Real-Time Collision Detection (2005), section 5.1.9, without a branch.
std::size_t Approaches::measure(const FibreBody& body, std::span<const FibrePair> pairs) {
  const std::size_t count = std::min(kCount, pairs.size());
  for (std::size_t i = 0; i < count; ++i) {
    const FibrePair& pair = pairs[i];
    const FibreBody::Piece& u = body.pieces[pair.u];
    const FibreBody::Piece& v = body.pieces[pair.v];
    const glm::dvec3 p = body.begin_mm(u);
    const glm::dvec3 q = body.begin_mm(v);
    const glm::dvec3 copy(pair.copy.x * body.size_mm.x, pair.copy.y * body.size_mm.y, 0);
    const glm::dvec3 along_u = body.end_mm(u) - p;
    const glm::dvec3 along_v = body.end_mm(v) - q;
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<std::size_t>(axis);
      p_[at][i] = p[axis];
      q_[at][i] = q[axis] + copy[axis];
      along_u_[at][i] = along_u[axis];
      along_v_[at][i] = along_v[axis];
    }
  }
  for (std::size_t i = 0; i < kCount; ++i) {  // all of them: what is left from before does no harm
    const double ux = along_u_[0][i];
    const double uy = along_u_[1][i];
    const double uz = along_u_[2][i];
    const double vx = along_v_[0][i];
    const double vy = along_v_[1][i];
    const double vz = along_v_[2][i];
    const double bx = p_[0][i] - q_[0][i];
    const double by = p_[1][i] - q_[1][i];
    const double bz = p_[2][i] - q_[2][i];
    const double uu = std::max(ux * ux + uy * uy + uz * uz, kShortest2);
    const double vv = std::max(vx * vx + vy * vy + vz * vz, kShortest2);
    const double uv = ux * vx + uy * vy + uz * vz;
    const double ub = ux * bx + uy * by + uz * bz;
    const double vb = vx * bx + vy * by + vz * bz;
    const double denominator = uu * vv - uv * uv;
    const double crossing = clamped((uv * vb - ub * vv) / denominator);
    // Parallel: any place is as close, the middle moves both ends.
    const double first_u = denominator > 1e-12 * uu * vv ? crossing : 0.5;
    const double free_v = (uv * first_u + vb) / vv;
    const double at_v = clamped(free_v);
    const double back_u = clamped((uv * at_v - ub) / uu);
    const double at_u = free_v == at_v ? first_u : back_u;
    const double x = q_[0][i] + vx * at_v - p_[0][i] - ux * at_u;
    const double y = q_[1][i] + vy * at_v - p_[1][i] - uy * at_u;
    const double z = q_[2][i] + vz * at_v - p_[2][i] - uz * at_u;
    at_u_[i] = at_u;
    at_v_[i] = at_v;
    gap_[0][i] = x;
    gap_[1][i] = y;
    gap_[2][i] = z;
    gap2_[i] = x * x + y * y + z * z;
  }
  return count;
}

std::vector<FibrePair> close_pairs(const FibreBody& body, double margin_mm, unsigned most_threads) {
  if (body.pieces.empty()) {
    return {};
  }
  const PieceGrid grid(body, margin_mm);
  const auto rows = static_cast<std::size_t>(grid.cells().y);
  std::vector<std::vector<FibrePair>> of_row(rows * static_cast<std::size_t>(grid.cells().z));
  core::in_parallel(
      of_row.size(),
      [&](std::size_t i) {
        of_row[i] = RowPairs(grid).collect(static_cast<int>(i % rows), static_cast<int>(i / rows));
      },
      most_threads);
  std::vector<FibrePair> pairs;
  for (std::vector<FibrePair>& some : of_row) {
    pairs.insert(pairs.end(), some.begin(), some.end());
    some = {};
  }
  return pairs;
}

}  // namespace weft::fabric
