#include "render/flat_cloth.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/check.h"

namespace weft::render {
namespace {

// Contact of less than this with the solid cloth is rounding, not shadow.
constexpr double kContactMm = 1e-6;

// The part of a line inside the box of the cloth, and the face through which it goes in and out:
// the axis, and whether that face is the upper one of the axis.
struct Passage {
  double enter_mm;
  double leave_mm;
  int enter_axis = -1;
  int leave_axis = -1;
};

class FlatCloth : public Cloth {
 public:
  FlatCloth(ClothFabric fabrics, const FlatPlacement& placement)
      : fabrics_(std::move(fabrics)), placement_(placement), origin_mm_(placement.centre_mm) {
    const double c = std::cos(placement.turn);
    const double s = std::sin(placement.turn);
    // Columns: the images of the world's axes under the turn back.
    to_flat_ = glm::dmat3(glm::dvec3(c, -s, 0), glm::dvec3(s, c, 0), glm::dvec3(0, 0, 1));
    const glm::dvec2 half = placement.endless ? glm::dvec2(kInfinity) : 0.5 * placement.size_mm;
    low_ = glm::dvec3(-half, fabrics_.low_mm());
    high_ = glm::dvec3(half, fabrics_.high_mm());
    if (fabrics_.pattern() != nullptr) {
      const glm::dvec3 to_corner(0.5 * placement.size_mm, 0);
      origin_mm_ -= glm::transpose(to_flat_) * to_corner;
      low_ += to_corner;
      high_ += to_corner;
    }
  }

  [[nodiscard]] const ClothFabric& fabrics() const override { return fabrics_; }

  [[nodiscard]] Meeting closest(const Ray& ray, double t_max_mm,
                                const FibreHit* from) const override {
    const Ray flat = flat_ray(ray);
    const std::optional<Passage> passage = passage_of(flat);
    Meeting meeting;
    if (!passage || passage->leave_mm <= 0 || passage->enter_mm >= t_max_mm) {
      return meeting;
    }
    const bool from_below =
        passage->enter_mm > 0 && passage->enter_axis == 2 && flat.direction.z > 0;
    if (placement_.black_underlay && from_below) {
      return {Fate::kAbsorbed, passage->enter_mm, {}};
    }
    const double start = std::max(0.0, start_of(*passage));
    const double end = std::min(passage->leave_mm, t_max_mm);
    std::optional<FibreHit> hit = fibre_between(ray, flat, start, end, from);
    if (hit) {
      return {Fate::kFibre, hit->t_mm, *hit};
    }
    if (placement_.black_underlay && leaves_below(*passage, flat) && passage->leave_mm < t_max_mm) {
      return {Fate::kAbsorbed, passage->leave_mm, {}};
    }
    return meeting;
  }

  [[nodiscard]] LocalMeeting closest_local(const Ray& ray, const FibreHit& from) const override {
    Ray flat = flat_ray(ray);
    // A hit on the highest fibres may be rounded out of the cloth.
    flat.origin_mm.z = std::clamp(flat.origin_mm.z, low_.z, high_.z);
    const std::optional<Passage> passage = passage_of(flat);
    if (!passage) {  // beyond a border
      return {};
    }
    const std::optional<FibreHit> hit =
        fibre_between(ray, flat, std::max(0.0, start_of(*passage)), passage->leave_mm, &from);
    if (hit) {
      return {LocalFate::kFibre, hit->t_mm, *hit};
    }
    const bool top = passage->leave_axis == 2 && flat.direction.z > 0;
    return {top ? LocalFate::kTop : LocalFate::kElsewhere, passage->leave_mm, {}};
  }

  [[nodiscard]] bool blocks(const Ray& ray, double t_max_mm) const override {
    const std::optional<Passage> passage = passage_of(flat_ray(ray));
    return passage &&
           std::min(passage->leave_mm, t_max_mm) - std::max(0.0, passage->enter_mm) > kContactMm;
  }

  [[nodiscard]] std::optional<glm::dvec3> top_point(const FibreHit& hit,
                                                    const glm::dvec2& offset_mm) const override {
    const glm::dvec3 flat(glm::dvec2(hit.flat_mm) + offset_mm, high_.z);
    if (flat.x < low_.x || flat.x > high_.x || flat.y < low_.y || flat.y > high_.y) {
      return std::nullopt;
    }
    return glm::transpose(to_flat_) * flat + origin_mm_;
  }

  [[nodiscard]] std::optional<glm::mat3> constant_rotation() const override {
    return glm::mat3(to_flat_);
  }

  [[nodiscard]] ClothForm form() const override {
    return {placement_.black_underlay, FlatForm{to_flat_, origin_mm_, low_, high_}};
  }

  [[nodiscard]] Bounds bounds() const override {
    const glm::dvec2 half = 0.5 * placement_.size_mm;
    const double c = std::fabs(std::cos(placement_.turn));
    const double s = std::fabs(std::sin(placement_.turn));
    const glm::dvec2 reach(c * half.x + s * half.y, s * half.x + c * half.y);
    return {placement_.centre_mm + glm::dvec3(-reach, low_.z),
            placement_.centre_mm + glm::dvec3(reach, high_.z)};
  }

 private:
  [[nodiscard]] Ray flat_ray(const Ray& ray) const {
    return {to_flat_ * (ray.origin_mm - origin_mm_), to_flat_ * ray.direction};
  }

  // The highest fibres touch the surface: a ray that began on it might begin inside them.
  [[nodiscard]] double start_of(const Passage& passage) const {
    return passage.enter_axis == 2 ? passage.enter_mm - 0.01 * (high_.z - low_.z)
                                   : passage.enter_mm;
  }

  static bool leaves_below(const Passage& passage, const Ray& flat) {
    return passage.leave_axis == 2 && flat.direction.z < 0;
  }

  [[nodiscard]] std::optional<Passage> passage_of(const Ray& flat) const {
    Passage passage{-kInfinity, kInfinity};
    for (int axis = 0; axis < 3; ++axis) {
      const double origin = flat.origin_mm[axis];
      const double direction = flat.direction[axis];
      if (direction == 0) {
        if (origin < low_[axis] || origin > high_[axis]) {
          return std::nullopt;
        }
        continue;
      }
      const double a = (low_[axis] - origin) / direction;
      const double b = (high_[axis] - origin) / direction;
      if (std::min(a, b) > passage.enter_mm) {
        passage.enter_mm = std::min(a, b);
        passage.enter_axis = axis;
      }
      if (std::max(a, b) < passage.leave_mm) {
        passage.leave_mm = std::max(a, b);
        passage.leave_axis = axis;
      }
    }
    if (!(passage.enter_mm < passage.leave_mm) || passage.leave_mm < 0) {
      return std::nullopt;
    }
    // In endless cloth a level ray never leaves; transport gives it up after its own limit.
    passage.leave_mm = std::min(passage.leave_mm, 1e6);
    return passage;
  }

  [[nodiscard]] std::optional<FibreHit> fibre_between(const Ray& ray, const Ray& flat, double start,
                                                      double end, const FibreHit* from) const {
    if (!(end > start)) {
      return std::nullopt;
    }
    std::optional<FlatStart> own;
    if (from != nullptr) {
      own = FlatStart{from->copy, from->fabric};
    }
    const std::optional<FlatHit> found =
        fabrics_.closest(flat.at(start), (end - start) * flat.direction, own);
    if (!found) {
      return std::nullopt;
    }
    FibreHit hit;
    hit.t_mm = start + found->share * (end - start);
    hit.segment = found->segment;
    hit.copy = found->copy;
    hit.fabric = found->fabric;
    hit.world_mm = ray.at(hit.t_mm);
    hit.flat_mm = flat.at(hit.t_mm);
    hit.to_flat = glm::mat3(to_flat_);
    hit.tangent = tangent_of(fabric(hit).tile(), hit.segment);
    return hit;
  }

  ClothFabric fabrics_;
  FlatPlacement placement_;
  glm::dvec3 origin_mm_;  // of the flat fabric, in the world
  glm::dmat3 to_flat_{1};
  glm::dvec3 low_{0, 0, 0};  // the box of the cloth in the flat fabric
  glm::dvec3 high_{0, 0, 0};
};

}  // namespace

std::unique_ptr<Cloth> make_flat_cloth(ClothFabric fabrics, const FlatPlacement& placement) {
  CHECK(placement.size_mm.x > 0 && placement.size_mm.y > 0);
  return std::make_unique<FlatCloth>(std::move(fabrics), placement);
}

std::unique_ptr<Cloth> make_flat_cloth(std::shared_ptr<const Fabric> fabric,
                                       const FlatPlacement& placement) {
  return make_flat_cloth(ClothFabric(std::move(fabric)), placement);
}

}  // namespace weft::render
