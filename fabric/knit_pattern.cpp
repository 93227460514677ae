#include "fabric/knit_pattern.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>

#include <glm/geometric.hpp>

#include "core/error.h"
#include "fabric/catmull_rom.h"
#include "fabric/weave_layout.h"

namespace weft::fabric {

namespace {

constexpr double kMostVertices = 1 << 20;
constexpr double kNodeSpacingRadii = 0.35;
constexpr double kMostTilesCrossed = 1 << 10;

[[noreturn]] void refuse(std::size_t line, const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument,
                    "pattern line " + std::to_string(line) + ": " + what);
}

// One line that is not blank, without its comment.
struct Line {
  std::size_t number = 0;
  std::string_view text;
};

std::vector<Line> lines_of(std::string_view text) {
  std::vector<Line> lines;
  std::size_t number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    line = line.substr(0, line.find('#'));
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string_view::npos) {
      continue;
    }
    lines.push_back({number, line.substr(first, line.find_last_not_of(" \t\r") - first + 1)});
  }
  return lines;
}

// Exactly `count` finite numbers.
std::vector<double> numbers_of(const Line& line, std::size_t count, const char* what) {
  std::vector<double> numbers;
  const char* at = line.text.data();
  const char* end = at + line.text.size();
  while (at != end) {
    double value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || !std::isfinite(value) ||
        (next != end && *next != ' ' && *next != '\t')) {
      refuse(line.number,
             "expected " + std::string(what) + ", found '" + std::string(line.text) + "'");
    }
    numbers.push_back(value);
    at = std::find_if(next, end, [](char c) { return c != ' ' && c != '\t'; });
  }
  if (numbers.size() != count) {
    refuse(line.number,
           "has " + std::to_string(numbers.size()) + " numbers; expected " + std::string(what));
  }
  return numbers;
}

struct Edge {
  std::size_t line = 0;
  std::uint32_t to = 0;
  glm::ivec2 tiles{0, 0};
};

class PatternReader {
 public:
  explicit PatternReader(std::string_view text) : lines_(lines_of(text)) {}

  KnitPattern read() {
    read_sections();
    const std::size_t end = lines_.empty() ? 1 : lines_.back().number;
    if (count_ == 0) {
      refuse(end, "the file ends without a '*pattern' section");
    }
    if (vertices_.size() != count_ || edge_count_ != count_) {
      refuse(end, "'*pattern' promises " + std::to_string(count_) +
                      " vertices and as many edges, but there are " +
                      std::to_string(vertices_.size()) + " and " + std::to_string(edge_count_));
    }
    follow_edges();
    return std::move(pattern_);
  }

 private:
  void read_sections() {
    std::string section;
    for (const Line& line : lines_) {
      if (line.text.front() == '*') {
        section = std::string(line.text.substr(1, line.text.find_first_of(" \t") - 1));
        if (section != "pattern" && count_ == 0) {
          refuse(line.number, "section '*" + section + "' comes before '*pattern'");
        }
        if (section == "E" && vertices_.size() != count_) {
          refuse(line.number, "'*Q' has " + std::to_string(vertices_.size()) +
                                  " vertices, but '*pattern' promises " + std::to_string(count_));
        }
      } else if (section == "pattern") {
        read_pattern(line);
      } else if (section == "Q") {
        const std::vector<double> q = numbers_of(line, 4, "x, y, z and twist");
        vertices_.emplace_back(q[0], q[1], q[2]);
      } else if (section == "E") {
        read_edge(line);
      } else if (section.empty()) {
        refuse(line.number, "expected a section, such as '*pattern'");
      }
    }
  }

  void read_pattern(const Line& line) {
    if (count_ != 0) {
      refuse(line.number, "a second row in '*pattern'");
    }
    const std::vector<double> p =
        numbers_of(line, 4, "size x, size y, radius and number of vertices");
    if (!(p[0] > 0 && p[1] > 0 && p[2] > 0)) {
      refuse(line.number, "size and radius must be positive");
    }
    if (p[3] < 3 || p[3] > kMostVertices || p[3] != std::floor(p[3])) {
      refuse(line.number, "the number of vertices must be a whole number from 3 to 1048576");
    }
    pattern_.size = {p[0], p[1]};
    pattern_.radius = p[2];
    count_ = static_cast<std::size_t>(p[3]);
    next_.resize(count_);
    reached_from_.resize(count_);
  }

  void read_edge(const Line& line) {
    const std::vector<double> e = numbers_of(line, 4, "two vertices and the tiles crossed");
    for (const double value : e) {
      if (value != std::floor(value)) {
        refuse(line.number, "an edge takes whole numbers");
      }
    }
    if (e[0] < 0 || e[1] < 0 || e[0] >= static_cast<double>(count_) ||
        e[1] >= static_cast<double>(count_)) {
      refuse(line.number, "an edge names a vertex that is not there; they are numbered from 0 to " +
                              std::to_string(count_ - 1));
    }
    if (std::abs(e[2]) > kMostTilesCrossed || std::abs(e[3]) > kMostTilesCrossed) {
      refuse(line.number, "an edge crosses more than 1024 tiles");
    }
    const auto from = static_cast<std::uint32_t>(e[0]);
    const auto to = static_cast<std::uint32_t>(e[1]);
    if (next_[from].line != 0) {
      refuse(line.number, "vertex " + std::to_string(from) + " already goes on, by line " +
                              std::to_string(next_[from].line));
    }
    if (reached_from_[to] != 0) {
      refuse(line.number, "vertex " + std::to_string(to) + " is already reached, by line " +
                              std::to_string(reached_from_[to]));
    }
    next_[from] = {line.number, to, {static_cast<int>(e[2]), static_cast<int>(e[3])}};
    reached_from_[to] = line.number;
    ++edge_count_;
  }

  // As many edges as vertices, none leaving or reaching one twice: every vertex lies on one cycle.
  void follow_edges() {
    std::vector<bool> taken(count_, false);
    for (std::uint32_t first = 0; first < count_; ++first) {
      if (taken[first]) {
        continue;
      }
      KnitPattern::Curve curve;
      std::uint32_t at = first;
      while (!taken[at]) {
        taken[at] = true;
        curve.vertices.push_back(vertices_[at] +
                                 glm::dvec3(glm::dvec2(curve.period) * pattern_.size, 0));
        curve.period += next_[at].tiles;
        at = next_[at].to;
      }
      if (curve.vertices.size() < 3) {
        refuse(next_[first].line,
               "the curve through vertex " + std::to_string(first) + " has fewer than 3 vertices");
      }
      check_steps(curve, first);
      pattern_.curves.push_back(std::move(curve));
    }
  }

  void check_steps(const KnitPattern::Curve& curve, std::uint32_t first) const {
    for (std::size_t k = 0; k < curve.vertices.size(); ++k) {
      const glm::dvec3 to =
          k + 1 < curve.vertices.size()
              ? curve.vertices[k + 1]
              : curve.vertices[0] + glm::dvec3(glm::dvec2(curve.period) * pattern_.size, 0);
      if (glm::distance(curve.vertices[k], to) < 1e-3 * pattern_.radius) {
        refuse(next_[first].line, "the curve through vertex " + std::to_string(first) +
                                      " stands still between two of its vertices");
      }
    }
  }

  std::vector<Line> lines_;
  KnitPattern pattern_;
  std::size_t count_ = 0;
  std::size_t edge_count_ = 0;
  std::vector<glm::dvec3> vertices_;
  std::vector<Edge> next_;
  std::vector<std::size_t> reached_from_;  // line of the edge, 0: none
};

YarnCurve smooth_curve(const KnitPattern::Curve& source, glm::dvec2 size, double scale,
                       double radius_mm) {
  YarnCurve curve;
  curve.radius_mm = radius_mm;
  curve.role = Role::kCurve;
  curve.period = source.period;
  const auto count = static_cast<int>(source.vertices.size());
  const glm::dvec3 period{glm::dvec2(source.period) * size, 0};
  const auto vertex = [&](int k) {
    const int turns = k < 0 ? -1 : k / count;
    const glm::dvec3 at = source.vertices[static_cast<std::size_t>(k - turns * count)];
    return (at + period * static_cast<double>(turns)) * scale;
  };
  for (int k = 0; k < count; ++k) {
    const double step = glm::distance(vertex(k), vertex(k + 1));
    const int pieces =
        std::clamp(static_cast<int>(std::ceil(step / (kNodeSpacingRadii * radius_mm))), 1, 64);
    for (int n = 0; n < pieces; ++n) {
      curve.nodes.push_back({catmull_rom(vertex(k - 1), vertex(k), vertex(k + 1), vertex(k + 2),
                                         static_cast<double>(n) / pieces),
                             radius_mm, radius_mm});
    }
  }
  return curve;
}

}  // namespace

KnitPattern parse_pyp(std::string_view text) { return PatternReader(text).read(); }

YarnLayout lay_out_curves(const v1::FabricDescription& description) {
  const v1::YarnCurves& source = description.yarn_curves();
  const KnitPattern pattern = parse_pyp(source.pyp_text());
  const std::uint32_t yarn = yarn_index(description, source.yarn());
  const double scale = source.scale();
  const v1::Yarn& described = description.yarns(static_cast<int>(yarn));
  const double radius_mm =
      source.pin_radius() ? pattern.radius * scale : described.yarn_radius_mm();
  YarnLayout layout;
  layout.size_mm = pattern.size * scale;
  for (const KnitPattern::Curve& curve : pattern.curves) {
    layout.curves.push_back(smooth_curve(curve, pattern.size, scale, radius_mm));
    layout.curves.back().yarn = yarn;
    layout.curves.back().flattening = described.flattening();
  }
  return layout;
}

}  // namespace weft::fabric
