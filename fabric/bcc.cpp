#include "fabric/bcc.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/error.h"

namespace weft::fabric {
namespace {

constexpr std::size_t kHeaderBytes = 64;
constexpr double kFarthest = 1e6;

class Bytes {
 public:
  Bytes(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw core::Error(core::Code::kInvalidArgument,
                      name_ + ": byte " + std::to_string(at_) + ": " + what);
  }
  template <class T>
  T take() {
    if (bytes_.size() - at_ < sizeof(T)) {
      fail("the file ends within its curves; it was cut short, get it again");
    }
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }

 private:
  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
};

glm::dvec3 point_of(Bytes& bytes, bool y_up) {
  std::array<double, 3> p{};
  for (double& coordinate : p) {
    coordinate = static_cast<double>(bytes.take<float>());
    if (!(std::fabs(coordinate) <= kFarthest)) {
      bytes.fail("a coordinate is not finite or farther than 1e6 from the origin");
    }
  }
  return y_up ? glm::dvec3(p[0], -p[2], p[1]) : glm::dvec3(p[0], p[1], p[2]);
}

}  // namespace

std::vector<BccCurve> read_bcc(std::string_view text, const std::string& name) {
  Bytes bytes(text, name);
  if (text.size() < kHeaderBytes || text.substr(0, 3) != "BCC") {
    bytes.fail("the file does not begin as a binary curve collection does; is it one?");
  }
  if (text.size() > kMostBccBytes) {
    bytes.fail("the file has " + std::to_string(text.size()) + " bytes; at most " +
               std::to_string(kMostBccBytes) + " are read");
  }
  (void)bytes.take<std::array<char, 3>>();
  if (bytes.take<std::uint8_t>() != 0x44) {
    bytes.fail("its numbers are not of four bytes each; write it with 32-bit integers and floats");
  }
  (void)bytes.take<std::array<char, 2>>();  // the kind of curve: points are joined smoothly here
  const auto dimensions = bytes.take<std::uint8_t>();
  const auto up = bytes.take<std::uint8_t>();
  if (dimensions != 3 || up > 2 || up == 0) {
    bytes.fail("only curves in three dimensions with y or z up are read");
  }
  const auto curve_count = bytes.take<std::uint64_t>();
  const auto point_count = bytes.take<std::uint64_t>();
  (void)bytes.take<std::array<char, 40>>();
  if (curve_count == 0 || point_count > kMostBccPoints || curve_count > point_count) {
    bytes.fail("it states " + std::to_string(curve_count) + " curves and " +
               std::to_string(point_count) + " points; 1 to " + std::to_string(kMostBccPoints) +
               " points are possible");
  }
  std::vector<BccCurve> curves;
  std::uint64_t points = 0;
  for (std::uint64_t c = 0; c < curve_count; ++c) {
    const auto stated = std::int64_t{bytes.take<std::int32_t>()};
    BccCurve& curve = curves.emplace_back();
    curve.closed = stated < 0;
    const auto count = static_cast<std::uint64_t>(curve.closed ? -stated : stated);
    points += count;
    if (count < 2 || points > point_count || count * 12 > bytes.left()) {
      bytes.fail("curve " + std::to_string(c + 1) + " states " + std::to_string(count) +
                 " points; at least 2, and no more than the file has");
    }
    for (std::uint64_t i = 0; i < count; ++i) {
      curve.points.push_back(point_of(bytes, up == 1));
    }
  }
  return curves;
}

std::vector<PeriodicCurve> periodic_curves(const std::vector<BccCurve>& curves,
                                           const CurveTiling& tiling) {
  std::vector<PeriodicCurve> result;
  for (const BccCurve& given : curves) {
    PeriodicCurve& made = result.emplace_back();
    made.curve.closed = given.closed;
    for (const glm::dvec3& point : given.points) {
      made.curve.points.push_back(tiling.mm_per_unit * point);
    }
    if (given.closed) {
      made.is_periodic = true;
      continue;
    }
    const glm::dvec3 way = made.curve.points.back() - made.curve.points.front();
    const glm::dvec2 tiles = glm::round(glm::dvec2(way) / tiling.period_mm);
    const glm::dvec3 off(glm::dvec2(way) - tiles * tiling.period_mm, way.z);
    const bool moves = tiles.x != 0 || tiles.y != 0;
    if (moves && glm::length(off) <= 0.5 * tiling.radius_mm && glm::length(tiles) < 1e4) {
      made.is_periodic = true;
      made.period = glm::ivec2(tiles);
      made.curve.points.pop_back();
    }
  }
  return result;
}

std::string pattern_text(const std::vector<BccCurve>& curves, const CurveTiling& tiling,
                         const std::string& name) {
  const std::vector<PeriodicCurve> all = periodic_curves(curves, tiling);
  std::size_t points = 0;
  for (std::size_t c = 0; c < all.size(); ++c) {
    if (!all[c].is_periodic) {
      throw core::Error(core::Code::kInvalidArgument,
                        name + ": curve " + std::to_string(c + 1) +
                            " ends, and not where it begins in another tile; give the period "
                            "after which the yarns repeat, or read the curves --as fibres");
    }
    points += all[c].curve.points.size();
  }
  std::array<char, 128> line{};
  const auto printed = [&line](const char* format, auto... values) {
    const int length = std::snprintf(line.data(), line.size(), format, values...);
    return std::string(line.data(), static_cast<std::size_t>(length));
  };
  std::string text = "*pattern # px py radius num_vertedges, millimetres\n";
  text += printed("%.9g %.9g %.9g %zu\n", tiling.period_mm.x, tiling.period_mm.y, tiling.radius_mm,
                  points);
  text += "*Q # dofs: x y z t\n";
  for (const PeriodicCurve& curve : all) {
    for (const glm::dvec3& p : curve.curve.points) {
      text += printed("%.9g %.9g %.9g 0\n", p.x, p.y, p.z);
    }
  }
  text += "*E # edges [v0, v1, dx, dy]\n";
  std::size_t first = 0;
  for (const PeriodicCurve& curve : all) {
    const std::size_t count = curve.curve.points.size();
    for (std::size_t i = 0; i < count; ++i) {
      const bool last = i + 1 == count;
      text += printed("%zu %zu %d %d\n", first + i, first + (last ? 0 : i + 1),
                      last ? curve.period.x : 0, last ? curve.period.y : 0);
    }
    first += count;
  }
  return text;
}

v1::ExplicitFibres explicit_fibres(const std::vector<BccCurve>& curves, const CurveTiling& tiling,
                                   const std::string& material) {
  v1::ExplicitFibres fibres;
  fibres.set_size_x_mm(tiling.period_mm.x);
  fibres.set_size_y_mm(tiling.period_mm.y);
  for (const PeriodicCurve& curve : periodic_curves(curves, tiling)) {
    v1::ExplicitFibres::Fibre& fibre = *fibres.add_fibres();
    fibre.set_material(material);
    fibre.set_radius_mm(tiling.radius_mm);
    fibre.set_period_x(curve.period.x);
    fibre.set_period_y(curve.period.y);
    const auto add = [&fibre](const glm::dvec3& p) {
      for (const double coordinate : {p.x, p.y, p.z}) {
        fibre.add_points_mm(coordinate);
      }
    };
    for (const glm::dvec3& point : curve.curve.points) {
      add(point);
    }
    if (curve.is_periodic) {
      add(curve.curve.points.front() + glm::dvec3(glm::dvec2(curve.period) * tiling.period_mm, 0));
    }
  }
  return fibres;
}

}  // namespace weft::fabric
