#include "render/shell_cloth.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/check.h"
#include "render/triangle_scene.h"

namespace weft::render {
namespace {

// A walk through the shell, or from triangle to triangle, that takes more steps is going round in
// a fold, and is given up.
constexpr int kMaxSteps = 100000;

// A face of the shell's outside.
struct OuterFace {
  std::uint32_t tetrahedron;
  std::uint32_t face;
};

// A stay of a ray in the shell: from where it is to where it leaves, or to a fibre.
struct Stay {
  std::optional<FibreHit> hit;
  Outside left_by = Outside::kBorder;  // REQUIRES: !hit
  double end_mm = 0;
};

class ShellCloth : public Cloth {
 public:
  ShellCloth(ClothFabric fabrics, ShellGeometry shell, double thickness_mm, bool black_underlay)
      : fabrics_(std::move(fabrics)),
        shell_(std::move(shell)),
        black_underlay_(black_underlay),
        faces_(outer_faces(shell_)),
        outside_(corners_of(shell_, faces_)) {
    bounds_ = {glm::dvec3(kInfinity), glm::dvec3(-kInfinity)};
    for (const Tetrahedron& tetrahedron : shell_.tetrahedra) {
      for (const glm::dvec3& corner : tetrahedron.corners_mm) {
        bounds_.low_mm = glm::min(bounds_.low_mm, corner);
        bounds_.high_mm = glm::max(bounds_.high_mm, corner);
      }
    }
    const glm::dvec3 reach = glm::max(glm::abs(bounds_.low_mm), glm::abs(bounds_.high_mm));
    // Float rounding of the outside, and a hundredth of the cloth.
    contact_mm_ = 0.01 * thickness_mm + 4e-7 * std::max({reach.x, reach.y, reach.z});
  }

  [[nodiscard]] const ClothFabric& fabrics() const override { return fabrics_; }

  [[nodiscard]] Meeting closest(const Ray& ray, double t_max_mm,
                                const FibreHit* from) const override {
    double t = 0;
    if (from != nullptr) {
      const Stay stay = follow(ray, {from->place, -1, 0}, t_max_mm, from);
      if (const std::optional<Meeting> meeting = meeting_of(stay, t_max_mm)) {
        return *meeting;
      }
      t = stay.end_mm + kStepMm;
    }
    for (int step = 0; step < kMaxSteps && t < t_max_mm; ++step) {
      const std::optional<TriangleScene::Hit> met = outside_.closest(ray, t, t_max_mm);
      if (!met) {
        break;
      }
      const OuterFace& face = faces_[met->triangle];
      const Tetrahedron& tetrahedron = shell_.tetrahedra[face.tetrahedron];
      t = met->t_mm + kStepMm;
      if (glm::dot(tetrahedron.normals[face.face], ray.direction) >= 0) {
        continue;  // the way out, of a stay that is over
      }
      if (black_underlay_ &&
          tetrahedron.behind[face.face] == static_cast<std::int32_t>(Outside::kBottom)) {
        return {Fate::kAbsorbed, met->t_mm, {}};
      }
      const Stay stay =
          follow(ray, {face.tetrahedron, static_cast<int>(face.face), met->t_mm}, t_max_mm, from);
      if (const std::optional<Meeting> meeting = meeting_of(stay, t_max_mm)) {
        return *meeting;
      }
      t = std::max(t, stay.end_mm + kStepMm);
    }
    return {};
  }

  [[nodiscard]] LocalMeeting closest_local(const Ray& ray, const FibreHit& from) const override {
    const Stay stay = follow(ray, {from.place, -1, 0}, kInfinity, &from);
    if (stay.hit) {
      return {LocalFate::kFibre, stay.hit->t_mm, *stay.hit};
    }
    return {stay.left_by == Outside::kTop ? LocalFate::kTop : LocalFate::kElsewhere,
            std::max(0.0, stay.end_mm),
            {}};
  }

  [[nodiscard]] bool blocks(const Ray& ray, double t_max_mm) const override {
    return outside_.occluded(ray, contact_mm_, t_max_mm);
  }

  [[nodiscard]] std::optional<glm::dvec3> top_point(const FibreHit& hit,
                                                    const glm::dvec2& offset_mm) const override {
    const glm::dvec2 wanted = glm::dvec2(hit.flat_mm) + offset_mm;
    auto triangle = static_cast<std::size_t>(hit.place / 3);
    for (int step = 0; step < kMaxSteps; ++step) {
      const ShellTriangle& here = shell_.triangles[triangle];
      const std::optional<glm::dvec3> weights = barycentric(here.flat_mm, wanted);
      if (!weights) {
        return std::nullopt;
      }
      int lowest = 0;
      for (int i = 1; i < 3; ++i) {
        lowest = (*weights)[i] < (*weights)[lowest] ? i : lowest;
      }
      const std::int32_t across = here.across[static_cast<std::size_t>(lowest)];
      if ((*weights)[lowest] >= 0 || (across < 0 && (*weights)[lowest] > -kOnEdge)) {
        return weights->x * here.top_mm[0] + weights->y * here.top_mm[1] +
               weights->z * here.top_mm[2];
      }
      if (across < 0) {
        return std::nullopt;
      }
      triangle = static_cast<std::size_t>(across);
    }
    return std::nullopt;
  }

  [[nodiscard]] std::optional<glm::mat3> constant_rotation() const override { return std::nullopt; }
  [[nodiscard]] ClothForm form() const override {
    return {black_underlay_, ShellForm{&shell_, contact_mm_}};
  }
  [[nodiscard]] Bounds bounds() const override { return bounds_; }

 private:
  static constexpr double kStepMm = 1e-5;
  static constexpr double kOnEdge = 1e-6;

  // Where a ray enters the shell, or starts in it (face -1).
  struct Entry {
    std::uint32_t tetrahedron;
    int face;
    double t_mm;
  };

  static std::vector<OuterFace> outer_faces(const ShellGeometry& shell) {
    std::vector<OuterFace> faces;
    for (std::uint32_t k = 0; k < shell.tetrahedra.size(); ++k) {
      for (std::uint32_t face = 0; face < 4; ++face) {
        if (shell.tetrahedra[k].behind[face] < 0) {
          faces.push_back({k, face});
        }
      }
    }
    return faces;
  }

  static std::vector<glm::vec3> corners_of(const ShellGeometry& shell,
                                           const std::vector<OuterFace>& faces) {
    std::vector<glm::vec3> corners;
    for (const OuterFace& face : faces) {
      for (std::uint32_t i = 1; i < 4; ++i) {
        corners.emplace_back(shell.tetrahedra[face.tetrahedron].corners_mm[(face.face + i) % 4]);
      }
    }
    return corners;
  }

  static std::optional<glm::dvec3> barycentric(const std::array<glm::dvec2, 3>& p,
                                               const glm::dvec2& x) {
    const auto cross = [](const glm::dvec2& a, const glm::dvec2& b) {
      return a.x * b.y - a.y * b.x;
    };
    const double area = cross(p[1] - p[0], p[2] - p[0]);
    if (area == 0) {
      return std::nullopt;
    }
    const double b = cross(x - p[0], p[2] - p[0]) / area;
    const double c = cross(p[1] - p[0], x - p[0]) / area;
    return glm::dvec3(1 - b - c, b, c);
  }

  [[nodiscard]] std::optional<Meeting> meeting_of(const Stay& stay, double t_max_mm) const {
    if (stay.hit) {
      return Meeting{Fate::kFibre, stay.hit->t_mm, *stay.hit};
    }
    if (black_underlay_ && stay.left_by == Outside::kBottom && stay.end_mm < t_max_mm) {
      return Meeting{Fate::kAbsorbed, stay.end_mm, {}};
    }
    return std::nullopt;
  }

  // From tetrahedron to tetrahedron, until a fibre is met or the ray leaves the shell.
  [[nodiscard]] Stay follow(const Ray& ray, const Entry& entry, double t_max_mm,
                            const FibreHit* from) const {
    std::uint32_t k = entry.tetrahedron;
    int entered_by = entry.face;
    double t = entry.t_mm;
    // The highest fibres touch the surface: a ray that began on it might begin inside them.
    double start = entered_by >= 0 ? std::max(0.0, t - contact_mm_) : t;
    for (int step = 0; step < kMaxSteps; ++step) {
      const Tetrahedron& tetrahedron = shell_.tetrahedra[k];
      int leave = -1;
      double end = kInfinity;
      for (int face = 0; face < 4; ++face) {
        const auto f = static_cast<std::size_t>(face);
        const double speed = glm::dot(tetrahedron.normals[f], ray.direction);
        if (face == entered_by || !(speed > 0)) {
          continue;
        }
        const double reach =
            (tetrahedron.offsets_mm[f] - glm::dot(tetrahedron.normals[f], ray.origin_mm)) / speed;
        if (reach < end) {
          end = reach;
          leave = face;
        }
      }
      if (leave < 0) {
        return {std::nullopt, Outside::kBorder, t};
      }
      end = std::max(end, t);
      if (!tetrahedron.bare) {
        const std::optional<FibreHit> hit =
            fibre_between(ray, k, start, std::min(end, t_max_mm), from);
        if (hit) {
          return {hit, Outside::kBorder, hit->t_mm};
        }
      }
      const std::int32_t behind = tetrahedron.behind[static_cast<std::size_t>(leave)];
      if (behind < 0 || end >= t_max_mm) {
        return {std::nullopt, behind < 0 ? static_cast<Outside>(behind) : Outside::kBorder, end};
      }
      entered_by = face_towards(static_cast<std::uint32_t>(behind), k);
      k = static_cast<std::uint32_t>(behind);
      start = t = end;
    }
    return {std::nullopt, Outside::kBorder, t};
  }

  [[nodiscard]] int face_towards(std::uint32_t k, std::uint32_t neighbour) const {
    for (int face = 0; face < 4; ++face) {
      if (shell_.tetrahedra[k].behind[static_cast<std::size_t>(face)] ==
          static_cast<std::int32_t>(neighbour)) {
        return face;
      }
    }
    return -1;
  }

  [[nodiscard]] std::optional<FibreHit> fibre_between(const Ray& ray, std::uint32_t k, double start,
                                                      double end, const FibreHit* from) const {
    if (!(end > start)) {
      return std::nullopt;
    }
    const Tetrahedron& tetrahedron = shell_.tetrahedra[k];
    const glm::dvec3 flat_start = tetrahedron.to_flat * ray.at(start) + tetrahedron.shift_mm;
    const glm::dvec3 flat_way = (end - start) * (tetrahedron.to_flat * ray.direction);
    std::optional<FlatStart> own;
    if (from != nullptr) {
      own = FlatStart{from->copy, from->fabric};
    }
    const std::optional<FlatHit> found = fabrics_.closest(flat_start, flat_way, own);
    if (!found) {
      return std::nullopt;
    }
    FibreHit hit;
    hit.t_mm = start + found->share * (end - start);
    hit.segment = found->segment;
    hit.copy = found->copy;
    hit.fabric = found->fabric;
    hit.place = k;
    hit.world_mm = ray.at(hit.t_mm);
    hit.flat_mm = flat_start + found->share * flat_way;
    hit.to_flat = tetrahedron.rotation;
    hit.tangent = tangent_of(fabric(hit).tile(), hit.segment);
    return hit;
  }

  ClothFabric fabrics_;
  ShellGeometry shell_;
  bool black_underlay_;
  std::vector<OuterFace> faces_;
  TriangleScene outside_;
  Bounds bounds_;
  double contact_mm_ = 0;
};

}  // namespace

std::unique_ptr<Cloth> make_shell_cloth(std::shared_ptr<const Fabric> fabric, const ObjMesh& mesh,
                                        const ShellPlacement& placement,
                                        std::vector<std::string>& remarks) {
  return make_shell_cloth(ClothFabric(std::move(fabric)), mesh, placement, remarks);
}

std::unique_ptr<Cloth> make_shell_cloth(ClothFabric fabrics, const ObjMesh& mesh,
                                        const ShellPlacement& placement,
                                        std::vector<std::string>& remarks) {
  ShellShape shape;
  shape.texture_mm = placement.texture_mm;
  shape.flat_low_mm = fabrics.low_mm();
  shape.flat_high_mm = fabrics.high_mm();
  shape.thickness_mm =
      placement.thickness_mm > 0 ? placement.thickness_mm : shape.flat_high_mm - shape.flat_low_mm;
  shape.flip_normals = placement.flip_normals;
  ShellGeometry shell = build_shell(mesh, shape);
  if (shell.folded > 0) {
    remarks.push_back(std::to_string(shell.folded) + " of " +
                      std::to_string(shell.tetrahedra.size()) +
                      " tetrahedra of the shell are turned inside out: the cloth is too thick for "
                      "its sharpest bends; use a thinner shell or a finer mesh");
  }
  if (shell.bare > 0) {
    remarks.push_back(std::to_string(shell.bare) + " of " +
                      std::to_string(shell.tetrahedra.size()) +
                      " tetrahedra of the shell hold no cloth: they or their texture are flat");
  }
  return std::make_unique<ShellCloth>(std::move(fabrics), std::move(shell), shape.thickness_mm,
                                      placement.black_underlay);
}

}  // namespace weft::render
