#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "core/random.h"
#include "shading/fibre_bcsdf.h"
#include "transport/path_counts.h"
#include "transport/scene.h"

namespace weft::transport {

// A path through endless cloth, from where radiance arrives towards where it comes from. Every
// fibre hit is one scattering event (no surface cosine, no width factor); the fibre just hit is
// ignored by the ray that leaves it.
class Path {
 public:
  // Starts at the segment's bake point, its own strand ignored. `materials` by the tile's
  // material index; both references must outlive the path.
  Path(const Scene& scene, std::span<const shading::FibreBcsdf> materials, std::uint32_t segment,
       glm::vec3 direction);

  // Goes on to the next fibre; false when the path leaves the cloth.
  bool advance();

  // Samples a lobe and the direction to go on in, and multiplies the throughput by S cos / pdf.
  // Survives with a probability that leaves the largest channel near one (FibreBcsdf::odds), which
  // keeps the expectation. False when the path ends here. REQUIRES: advance() returned true.
  bool scatter(core::Random& random);

  // The same by the numbers `u`, each in [0, 1), for a path that may go on as several: as many as
  // its throughput times `worth` says, rounded at random. The further ones, which draw their
  // directions from `random`, are appended to `others`, up to kMostOthers there; none is
  // heavier than 1 / worth by more than its lobe's width makes it. Keeps the expectation of their
  // sum for any worth above 0.
  bool scatter(glm::vec3 u, float worth, core::Random& random, std::vector<Path>& others);
  static constexpr std::size_t kMostOthers = 64;

  // S(towards_light, -direction) cos(theta) at the fibre just met, zero when another fibre hides
  // the light. REQUIRES: advance() returned true.
  [[nodiscard]] glm::vec3 reflected(glm::vec3 towards_light) const;

  [[nodiscard]] glm::vec3 direction() const { return direction_; }
  [[nodiscard]] glm::vec3 throughput() const { return throughput_; }
  [[nodiscard]] std::uint32_t vertices() const { return vertices_; }
  // Of the scatterings so far.
  [[nodiscard]] const PathCounts& counts() const { return counts_; }
  // Across and along the cloth, from the start to the last fibre met; and the height of where that
  // was met, before the first one of the start.
  [[nodiscard]] glm::dvec2 travelled_mm() const { return travelled_mm_; }
  [[nodiscard]] double height_mm() const { return static_cast<double>(position_mm_.z); }

 private:
  bool go_on(const shading::LobeOdds& odds, glm::vec3 u);
  void count(bool reflects, glm::vec3 omega_i);

  const Scene& scene_;
  std::span<const shading::FibreBcsdf> materials_;
  glm::vec3 position_mm_{0, 0, 0};
  glm::vec3 direction_;
  StrandCopy own_;  // relative to the tile that holds position_mm_
  glm::dvec2 travelled_mm_{0, 0};
  glm::vec3 throughput_{1, 1, 1};
  std::uint32_t vertices_ = 0;
  glm::mat3 frame_{1};  // of the fibre just met
  glm::vec3 omega_o_{0, 0, 0};
  const shading::FibreBcsdf* bcsdf_ = nullptr;
  std::uint32_t material_ = 0;  // of the fibre just met
  PathCounts counts_;
};

}  // namespace weft::transport
