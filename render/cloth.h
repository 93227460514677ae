#pragma once

#include <cstdint>
#include <optional>

#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/cloth_fabric.h"
#include "render/cloth_form.h"
#include "render/fabric.h"
#include "render/ray.h"
#include "transport/scene.h"

namespace weft::render {

// Where a ray met a fibre of a piece of cloth.
struct FibreHit {
  double t_mm = 0;             // along the ray, in the world
  std::uint32_t segment = 0;   // of the fabric's tile
  transport::StrandCopy copy;  // the strand, relative to tile (0, 0) of the flat fabric
  std::uint32_t fabric = 0;    // of the piece's: patterned cloth has several
  std::uint32_t place = 0;     // the piece's own mark of where it is (a shell: the tetrahedron)
  glm::dvec3 world_mm{0, 0, 0};
  glm::dvec3 flat_mm{0, 0, 0};  // the same point of the flat, endless fabric
  // Carries directions from the world to the flat fabric: the orthogonal polar factor of the map's
  // Jacobian (a reflection where the texture is mirrored).
  glm::mat3 to_flat{1};
  glm::vec3 tangent{1, 0, 0};  // of the fibre, unit, in the flat fabric
};

// How a ray through a piece of cloth ends.
enum class Fate {
  kNothing,   // it meets nothing of this piece
  kFibre,     // at a fibre
  kAbsorbed,  // at the black sheet under the cloth
};

struct Meeting {
  Fate fate = Fate::kNothing;
  double t_mm = kInfinity;  // where it ends
  FibreHit hit;             // REQUIRES: fate == kFibre
};

// How a ray that starts inside the cloth ends when it is followed no farther than the cloth's own
// surface, as the precomputation follows it.
enum class LocalFate {
  kFibre,
  kTop,        // it leaves through the upper surface, at `t_mm`
  kElsewhere,  // it leaves through the lower surface or a border: nothing comes from there
};

struct LocalMeeting {
  LocalFate fate = LocalFate::kElsewhere;
  double t_mm = 0;
  FibreHit hit;  // REQUIRES: fate == kFibre
};

// A piece of cloth in the world. Immutable: any thread may call.
class Cloth {
 public:
  Cloth() = default;
  Cloth(const Cloth&) = delete;
  Cloth& operator=(const Cloth&) = delete;
  Cloth(Cloth&&) = delete;
  Cloth& operator=(Cloth&&) = delete;
  virtual ~Cloth() = default;

  // What the piece is of.
  [[nodiscard]] virtual const ClothFabric& fabrics() const = 0;
  // The fabric that was met.
  [[nodiscard]] const Fabric& fabric(const FibreHit& hit) const {
    return *fabrics().fabrics()[hit.fabric];
  }
  // The only fabric; the first of several.
  [[nodiscard]] const Fabric& fabric() const { return *fabrics().fabrics().front(); }

  // The first fibre (or black sheet) that the ray enters before t_max_mm. `from`, when given, is
  // the hit on this piece at which the ray starts; its fibre is not met again.
  [[nodiscard]] virtual Meeting closest(const Ray& ray, double t_max_mm,
                                        const FibreHit* from) const = 0;

  // The same from a hit on this piece, up to the piece's own surface.
  [[nodiscard]] virtual LocalMeeting closest_local(const Ray& ray, const FibreHit& from) const = 0;

  // Whether the piece as a solid, every gap between its fibres filled, is in the ray's way. A ray
  // that starts on its surface and leads out of it is free.
  [[nodiscard]] virtual bool blocks(const Ray& ray, double t_max_mm) const = 0;

  // The point of the upper surface that lies above `hit` in the flat fabric, moved there by
  // `offset_mm`; nothing where that is beyond the border.
  [[nodiscard]] virtual std::optional<glm::dvec3> top_point(const FibreHit& hit,
                                                            const glm::dvec2& offset_mm) const = 0;

  // FibreHit::to_flat when it is the same at every hit.
  [[nodiscard]] virtual std::optional<glm::mat3> constant_rotation() const = 0;

  // How the piece lies in the world, for those who follow rays through it by other means.
  [[nodiscard]] virtual ClothForm form() const = 0;

  // A box around the piece, for framing; an endless piece gives a part of it.
  struct Bounds {
    glm::dvec3 low_mm;
    glm::dvec3 high_mm;
  };
  [[nodiscard]] virtual Bounds bounds() const = 0;
};

// Unit tangent of segment k.
[[nodiscard]] glm::vec3 tangent_of(const fabric::Tile& tile, std::uint32_t k);

}  // namespace weft::render
