#include "render/baselines/light_response.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <tbb/parallel_for.h>

#include "core/random.h"
#include "render/cloth.h"
#include "render/sphere_sampling.h"
#include "shading/spherical_gaussian.h"
#include "transport/path.h"

namespace weft::render {
namespace {

// Bins of 0.7 degrees: narrower than any Gaussian they are smoothed with.
constexpr std::uint32_t kRows = 256;
constexpr std::uint32_t kColumns = 512;
// Gaussians are cut where they are below exp(-20).
constexpr float kNegligibleExponent = 20;

}  // namespace

glm::vec3 direction_of_pixel(std::uint32_t x, std::uint32_t y, std::uint32_t width,
                             std::uint32_t height) {
  return direction_of(std::cos((y + 0.5) * kPi / height), (x + 0.5) * 2 * kPi / width);
}

LightResponse::LightResponse()
    : weights_(std::size_t{kRows} * kColumns, glm::dvec3(0)),
      squares_(std::size_t{kRows} * kColumns, glm::dvec3(0)) {}

void LightResponse::add(const glm::vec3& towards, const glm::vec3& weight) {
  const double polar = std::acos(std::clamp(static_cast<double>(towards.z), -1.0, 1.0));
  double azimuth =
      std::atan2(static_cast<double>(towards.y), static_cast<double>(towards.x)) / (2 * kPi);
  azimuth -= std::floor(azimuth);
  const auto row = std::min(kRows - 1, static_cast<std::uint32_t>(polar / kPi * kRows));
  const auto column = std::min(kColumns - 1, static_cast<std::uint32_t>(azimuth * kColumns));
  const std::size_t bin = std::size_t{row} * kColumns + column;
  weights_[bin] += glm::dvec3(weight);
  squares_[bin] += glm::dvec3(weight) * glm::dvec3(weight);
}

LightResponse::Map LightResponse::under_gaussian(float sharpness, std::uint32_t width,
                                                 std::uint32_t height) const {
  std::vector<std::size_t> filled;
  std::vector<glm::vec3> directions;
  for (std::size_t bin = 0; bin < weights_.size(); ++bin) {
    if (squares_[bin] != glm::dvec3(0)) {
      filled.push_back(bin);
      directions.push_back(direction_of_pixel(static_cast<std::uint32_t>(bin % kColumns),
                                              static_cast<std::uint32_t>(bin / kColumns), kColumns,
                                              kRows));
    }
  }
  const double mass = static_cast<double>(shading::sg_mass(sharpness));
  const float nearest = 1 - kNegligibleExponent / sharpness;
  const auto count = static_cast<double>(samples_);
  Map map{Image(width, height), Image(width, height)};
  tbb::parallel_for(std::uint32_t{0}, height, [&](std::uint32_t y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const shading::SphericalGaussian light{direction_of_pixel(x, y, width, height), sharpness};
      glm::dvec3 sum(0);
      glm::dvec3 square(0);
      for (std::size_t i = 0; i < filled.size(); ++i) {
        if (glm::dot(directions[i], light.axis) < nearest) {
          continue;
        }
        const double g = static_cast<double>(shading::sg_evaluate(light, directions[i])) / mass;
        sum += weights_[filled[i]] * g;
        square += squares_[filled[i]] * (g * g);
      }
      const glm::dvec3 mean = sum / count;
      map.radiance.at(x, y) = glm::vec3(mean);
      if (samples_ > 1) {
        const glm::dvec3 variance = (square / count - mean * mean) / (count - 1);
        map.standard_error.at(x, y) = glm::vec3(glm::sqrt(glm::max(variance, glm::dvec3(0))));
      }
    }
  });
  return map;
}

LightResponse measured_response(const Fabric& fabric, std::uint32_t segment,
                                const glm::vec3& omega_o, const ResponseSettings& settings) {
  const glm::vec3 tangent = tangent_of(fabric.tile(), segment);
  const glm::mat3 to_fibre = shading::fibre_frame(tangent, omega_o);
  const glm::vec3 local_o = to_fibre * omega_o;
  const shading::FibreBcsdf& bcsdf = fabric.bcsdf_of_strand(fabric.tile().segment_strand[segment]);
  LightResponse response;
  response.set_samples(settings.paths);
  for (std::uint64_t i = 0; i < settings.paths; ++i) {
    core::Random random(settings.seed, segment, i);
    const float u_lobe = random.uniform();
    const float u_theta = random.uniform();
    const shading::BcsdfSample sample = bcsdf.sample(local_o, u_lobe, u_theta, random.uniform());
    if (!(sample.pdf > 0)) {
      continue;
    }
    transport::Path path(fabric.scene(), fabric.bcsdfs(), segment,
                         glm::normalize(glm::transpose(to_fibre) * sample.omega_i));
    bool ends = false;
    while (!ends && path.advance()) {
      ends = settings.scattering == Scattering::kSingleOnly || !path.scatter(random);
    }
    const bool direct = path.vertices() == 0;
    if (ends || !(path.direction().z > 0) ||
        (direct && settings.scattering == Scattering::kMultipleOnly)) {
      continue;
    }
    response.add(path.direction(), sample.weight * path.throughput());
  }
  return response;
}

}  // namespace weft::render
