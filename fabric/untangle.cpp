#include "fabric/untangle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include <glm/geometric.hpp>

#include "core/parallel.h"
#include "fabric/fibre_pairs.h"

namespace weft::fabric {

namespace {

constexpr std::uint32_t kIterations = 60;
constexpr std::uint32_t kIterationsPerPairList = 4;
// Of pairs on the list, in the thinnest radius: what fibres move until the next list is made. It is
// made when more than a share of the nodes may have used up half of it with one another.
constexpr double kListMargin = 0.7;
constexpr double kListWorn = 0.25;  // of the margin
constexpr double kWornShare = 0.002;
constexpr double kMostMove = 0.3;  // of a node in one iteration, in its radius
constexpr double kPush = 1.4;      // of the mean correction of a node's contacts
// Fades from the first iteration to the last, so that contacts have the last word.
constexpr double kSmoothFirst = 0.5;
constexpr double kSmoothLast = 0.1;
constexpr double kPullFirst = 0.03;
constexpr std::size_t kPairsTogether = 64 * Approaches::kCount;  // that one thread takes at a time
constexpr double kTouching2 = 1e-18;  // squared gap without a direction, in square radii

double faded(double first, double last, std::uint32_t iteration) {
  return first + (last - first) * static_cast<double>(iteration) / (kIterations - 1);
}

glm::dvec3 any_across(glm::dvec3 direction) {
  const glm::dvec3 axis =
      std::abs(direction.z) * std::abs(direction.z) < 0.5 * glm::dot(direction, direction)
          ? glm::dvec3(0, 0, 1)
          : glm::dvec3(1, 0, 0);
  return glm::normalize(glm::cross(direction, axis));
}

class Untangling {
 public:
  Untangling(const Tile& tile, unsigned most_threads)
      : most_threads_(most_threads), body_(tile), laid_mm_(body_.nodes_mm) {
    radii_mm_.resize(body_.nodes_mm.size());
    thinnest_mm_ = std::numeric_limits<double>::max();
    for (const FibreBody::Piece& piece : body_.pieces) {
      radii_mm_[piece.a] = radii_mm_[piece.b] = piece.radius_mm;
      thinnest_mm_ = std::min(thinnest_mm_, piece.radius_mm);
    }
  }

  void run() {
    for (std::uint32_t n = 0; n < kIterations; ++n) {
      if (n % kIterationsPerPairList == 0 && is_list_worn()) {
        pairs_ = close_pairs(body_, kListMargin * thinnest_mm_, most_threads_);
        listed_mm_ = body_.nodes_mm;
      }
      push_apart();
      settle(faded(kSmoothFirst, kSmoothLast, n), faded(kPullFirst, 0, n));
    }
  }

  [[nodiscard]] const FibreBody& body() const { return body_; }

  [[nodiscard]] double mean_moved_mm() const {
    double sum = 0;
    for (std::size_t n = 0; n < laid_mm_.size(); ++n) {
      sum += glm::distance(laid_mm_[n], body_.nodes_mm[n]);
    }
    return laid_mm_.empty() ? 0 : sum / static_cast<double>(laid_mm_.size());
  }

 private:
  [[nodiscard]] bool is_list_worn() const {
    if (listed_mm_.empty()) {
      return true;
    }
    const double most = kListWorn * kListMargin * thinnest_mm_;
    std::size_t worn = 0;
    for (std::size_t n = 0; n < listed_mm_.size(); ++n) {
      const glm::dvec3 step = body_.nodes_mm[n] - listed_mm_[n];
      worn += glm::dot(step, step) > most * most ? 1 : 0;
    }
    return static_cast<double>(worn) > kWornShare * static_cast<double>(listed_mm_.size());
  }

  // Two pieces that overlap: where, and what brings them apart.
  struct Contact {
    FibrePair pair;
    double at_u = 0;
    double at_v = 0;
    glm::dvec3 move_mm{0};  // of v; u gives way as far the other way
  };

  // Contacts are found by all threads and act in the order of the pairs.
  void push_apart() {
    contacts_.resize((pairs_.size() + kPairsTogether - 1) / kPairsTogether);
    core::in_parallel(
        contacts_.size(), [this](std::size_t i) { find_contacts(i); }, most_threads_);
    corrections_mm_.assign(body_.nodes_mm.size(), glm::dvec3(0));
    weights_.assign(body_.nodes_mm.size(), 0);
    for (const std::vector<Contact>& some : contacts_) {
      for (const Contact& contact : some) {
        give(body_.pieces[contact.pair.u], contact.at_u, -contact.move_mm);
        give(body_.pieces[contact.pair.v], contact.at_v, contact.move_mm);
      }
    }
    for (std::size_t n = 0; n < body_.nodes_mm.size(); ++n) {
      if (weights_[n] > 0) {
        glm::dvec3 move = corrections_mm_[n] * (kPush / weights_[n]);
        const double length = glm::length(move);
        const double most = kMostMove * radii_mm_[n];
        body_.nodes_mm[n] += length > most ? move * (most / length) : move;
      }
    }
  }

  // Of the i-th kPairsTogether pairs.
  void find_contacts(std::size_t i) {
    std::vector<Contact>& contacts = contacts_[i];
    contacts.clear();
    Approaches approaches;
    std::span<const FibrePair> left(pairs_);
    left = left.subspan(i * kPairsTogether);
    left = left.first(std::min(left.size(), kPairsTogether));
    while (!left.empty()) {
      const std::size_t count = approaches.measure(body_, left);
      for (std::size_t k = 0; k < count; ++k) {
        add_if_touching(left[k], approaches, k, contacts);
      }
      left = left.subspan(count);
    }
  }

  // The pair whose approach is the k-th of `approaches`.
  void add_if_touching(const FibrePair& pair, const Approaches& approaches, std::size_t k,
                       std::vector<Contact>& contacts) const {
    const FibreBody::Piece& u = body_.pieces[pair.u];
    const FibreBody::Piece& v = body_.pieces[pair.v];
    const double apart = u.radius_mm + v.radius_mm;
    const double gap2 = approaches.gap2(k);
    if (gap2 >= apart * apart) {
      return;
    }
    const Approach approach = approaches[k];
    const double gap = std::sqrt(gap2);
    const glm::dvec3 away = gap2 > kTouching2 * apart * apart
                                ? approach.gap_mm / gap
                                : any_across(body_.end_mm(u) - body_.begin_mm(u));
    contacts.push_back({pair, approach.at_u, approach.at_v, away * (0.5 * (apart - gap))});
  }

  // Moves the place at `share` of the piece by `move`, with the least motion of its ends.
  void give(const FibreBody::Piece& piece, double share, glm::dvec3 move) {
    const double rest = 1 - share;
    const glm::dvec3 step = move / (rest * rest + share * share);
    corrections_mm_[piece.a] += step * (rest * rest);
    weights_[piece.a] += rest;
    corrections_mm_[piece.b] += step * (share * share);
    weights_[piece.b] += share;
  }

  // Levels displacements along every fibre and pulls them back.
  void settle(double smooth, double pull) {
    displacements_mm_.resize(body_.nodes_mm.size());
    core::in_parallel(
        body_.strand_periods.size(), [&](std::size_t s) { settle_strand(s, smooth, pull); },
        most_threads_);
  }

  void settle_strand(std::size_t s, double smooth, double pull) {
    const std::uint32_t first = body_.first_nodes[s];
    const std::uint32_t count = body_.first_nodes[s + 1] - first;
    const bool open = body_.strand_periods[s] == glm::ivec2(0, 0);
    for (std::uint32_t n = first; n < first + count; ++n) {
      displacements_mm_[n] = body_.nodes_mm[n] - laid_mm_[n];
    }
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t before = k > 0 ? k - 1 : (open ? 0 : count - 1);
      const std::uint32_t after = k + 1 < count ? k + 1 : (open ? k : 0);
      const glm::dvec3 level =
          0.5 * (displacements_mm_[first + before] + displacements_mm_[first + after]);
      const glm::dvec3 here = displacements_mm_[first + k];
      body_.nodes_mm[first + k] =
          laid_mm_[first + k] + (here + (level - here) * smooth) * (1 - pull);
    }
  }

  unsigned most_threads_;
  FibreBody body_;
  std::vector<glm::dvec3> laid_mm_;
  std::vector<double> radii_mm_;  // [node]
  double thinnest_mm_ = 0;
  std::vector<FibrePair> pairs_;
  std::vector<std::vector<Contact>> contacts_;  // [kPairsTogether pairs]
  std::vector<glm::dvec3> listed_mm_;           // the nodes when the list was made
  std::vector<glm::dvec3> corrections_mm_;
  std::vector<double> weights_;
  std::vector<glm::dvec3> displacements_mm_;
};

double distance2_to_piece(const FibreBody& body, const FibreBody::Piece& piece, glm::dvec3 place) {
  const glm::dvec3 a = body.begin_mm(piece);
  const glm::dvec3 along = body.end_mm(piece) - a;
  const double length2 = glm::dot(along, along);
  const double share = length2 > 0 ? std::clamp(glm::dot(place - a, along) / length2, 0.0, 1.0) : 0;
  const glm::dvec3 gap = place - a - along * share;
  return glm::dot(gap, gap);
}

}  // namespace

UntangleReport untangle(Tile& tile, unsigned most_threads) {
  Untangling untangling(tile, most_threads);
  untangling.run();
  untangling.body().write_to(tile);
  return {kIterations, buried_share(tile, most_threads), untangling.mean_moved_mm()};
}

double buried_share(const Tile& tile, unsigned most_threads) {
  const FibreBody body(tile);
  std::vector<bool> buried(body.pieces.size(), false);
  for (const FibrePair& pair : close_pairs(body, 0, most_threads)) {
    const FibreBody::Piece& u = body.pieces[pair.u];
    const FibreBody::Piece& v = body.pieces[pair.v];
    const glm::dvec3 copy(pair.copy.x * body.size_mm.x, pair.copy.y * body.size_mm.y, 0);
    const glm::dvec3 middle_u = 0.5 * (body.begin_mm(u) + body.end_mm(u));
    const glm::dvec3 middle_v = 0.5 * (body.begin_mm(v) + body.end_mm(v));
    if (distance2_to_piece(body, v, middle_u - copy) < v.radius_mm * v.radius_mm) {
      buried[pair.u] = true;
    }
    if (distance2_to_piece(body, u, middle_v + copy) < u.radius_mm * u.radius_mm) {
      buried[pair.v] = true;
    }
  }
  const auto count = std::count(buried.begin(), buried.end(), true);
  return buried.empty() ? 0 : static_cast<double>(count) / static_cast<double>(buried.size());
}

}  // namespace weft::fabric
