// How well visibility by a sum of spherical Gaussians (SSG) and by signed distance (SSDF) gives
// single scattering under spherical Gaussian lights: against rays, on segments that eyes see.
// Prints the table of docs/accuracy.md. Usage: bench_visibility_study DATABASE...
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "core/random.h"
#include "render/fabric.h"
#include "render/sphere_sampling.h"
#include "shading/single_scattering.h"
#include "shading/visibility.h"
#include "storage/fabric_database.h"
#include "transport/bake_point.h"
#include "transport/signed_distance.h"
#include "transport/visibility.h"
#include "transport/visibility_sg.h"

namespace weft::bench {
namespace {

constexpr std::array<double, 9> kSharpness = {5, 10, 20, 50, 100, 150, 200, 400, 1000};
constexpr int kSegments = 60;  // seen from each view
constexpr int kSamples = 192;  // of the BCSDF, and of each light
constexpr std::uint32_t kResolution = 128;
constexpr double kRadians = render::kPi / 180;

struct Gaussians {
  std::uint32_t count;
  double sharpness;
};
constexpr std::array<Gaussians, 7> kSums = {
    {{24, 64}, {48, 32}, {48, 64}, {48, 128}, {96, 64}, {96, 128}, {192, 128}}};
// Sums and signed distances blended between two sharpnesses; the last is the paper's.
struct Blend {
  std::size_t sum;  // of kSums
  float low;
  float high;
};
constexpr std::array<Blend, 4> kBlends = {{{2, 20, 50}, {2, 20, 80}, {2, 50, 100}, {3, 100, 200}}};
constexpr std::size_t kDistances = 2;  // by the database's components, and without loss

// What one segment sends to the eye under one light, by each representation and by rays.
struct Sent {
  float sharpness = 0;
  double reference = 0;
  std::array<double, kSums.size()> by_sum{};
  std::array<double, kDistances> by_distance{};
};

double grey(const glm::vec3& rgb) { return static_cast<double>(rgb.x + rgb.y + rgb.z) / 3; }

std::vector<glm::vec3> view_directions() {
  return {glm::vec3(0, 0, 1), glm::vec3(render::direction_of(std::cos(45 * kRadians), 0.6))};
}
std::vector<glm::vec3> light_directions() {
  std::vector<glm::vec3> directions{{0, 0, 1}};
  for (const double degrees : {25.0, 40.0, 60.0}) {
    for (int i = 0; i < 3; ++i) {
      directions.emplace_back(
          render::direction_of(std::cos(degrees * kRadians), degrees + i * 2 * render::kPi / 3));
    }
  }
  return directions;
}

struct Draw {
  glm::vec3 direction;
  glm::vec3 scattered;  // S cos(theta), 0 where it is not seen
  double density;       // of the BCSDF's sampler
};

// A segment that is seen, and what it sees.
class Seen {
 public:
  Seen(const render::Fabric& fabric, std::uint32_t segment, const glm::vec3& omega_o)
      : fabric_(fabric), from_(transport::bake_point(fabric.scene(), segment)) {
    const fabric::Segment ends = fabric.tile().segment(segment);
    point_ = fabric.precomputed()->point(segment, glm::normalize(ends.b_mm - ends.a_mm), omega_o);
    bits_ = transport::visibility_bits(fabric.scene(), segment, kResolution);
    distances_ = transport::signed_distance(bits_, kResolution);
    transport::correct_pixel_bias(distances_, kResolution);
    const std::uint16_t rotation = transport::sg_rotation(7, segment, kResolution);
    for (const Gaussians& sum : kSums) {
      axes_.push_back(transport::sg_axes(sum.count, rotation));
      weights_.push_back(transport::SgRegions(sum.count, kResolution).weights(bits_, rotation));
    }
  }

  [[nodiscard]] Draw draw_fibre(core::Random& random) const {
    const float u_lobe = random.uniform();
    const float u_theta = random.uniform();
    const shading::BcsdfSample sample =
        point_.bcsdf->sample(point_.omega_o, u_lobe, u_theta, random.uniform());
    if (!(sample.pdf > 0)) {
      return {{0, 0, 1}, glm::vec3(0), 0};
    }
    const glm::vec3 direction = glm::transpose(point_.to_fibre) * sample.omega_i;
    return {direction, sees(direction) ? sample.weight * sample.pdf : glm::vec3(0),
            static_cast<double>(sample.pdf)};
  }
  [[nodiscard]] Draw drawn(const glm::vec3& direction) const {
    const glm::vec3 local = point_.to_fibre * direction;
    const glm::vec3 scattered = point_.bcsdf->evaluate_cos(local, point_.omega_o);
    return {direction, grey(scattered) > 0 && sees(direction) ? scattered : glm::vec3(0),
            static_cast<double>(point_.bcsdf->pdf(local, point_.omega_o))};
  }

  [[nodiscard]] double by_sum(std::size_t k, const shading::SphericalGaussian& light) const {
    const auto sharpness = static_cast<float>(kSums[k].sharpness);
    glm::vec3 sum(0);
    for (std::size_t q = 0; q < axes_[k].size(); ++q) {
      const shading::SgProduct product = shading::sg_product({axes_[k][q], sharpness}, light);
      if (weights_[k][q] > 0 && product.log_scale > shading::kNegligibleLogScale) {
        sum += shading::gamma_of_seen(point_, point_.bcsdf->lobes(), product.sg,
                                      shading::kGammaHybrid) *
               (weights_[k][q] * std::exp(product.log_scale));
      }
    }
    return grey(sum) /
           static_cast<double>(shading::sg_mass(sharpness) * shading::sg_mass(light.sharpness));
  }

  [[nodiscard]] double by_distance(bool lossless, const shading::SphericalGaussian& light) const {
    const float distance = lossless
                               ? std::min(exact_distance(light.axis), std::asin(light.axis.z))
                               : fabric_.precomputed()->signed_distance(point_.segment, light.axis);
    return static_cast<double>(shading::ssdf_visibility(distance, light.sharpness)) *
           grey(fabric_.precomputed()->unoccluded_sg(point_, light));
  }

 private:
  [[nodiscard]] bool sees(const glm::vec3& direction) const {
    return direction.z > 0 &&
           !fabric_.scene().occluded(from_.position_mm, direction,
                                     std::numeric_limits<float>::infinity(), from_.own);
  }
  [[nodiscard]] float exact_distance(const glm::vec3& omega) const {
    const shading::MapFootprint footprint = shading::map_footprint(omega, kResolution);
    float distance = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      distance += footprint.weight[k] * distances_[static_cast<std::size_t>(footprint.index[k])];
    }
    return distance;
  }

  const render::Fabric& fabric_;
  transport::BakePoint from_;
  render::ShadingPoint point_;
  std::vector<std::uint8_t> bits_;
  std::vector<float> distances_;
  std::vector<std::vector<glm::vec3>> axes_;
  std::vector<std::vector<float>> weights_;
};

// Directions drawn from the light and from the BCSDF, weighed by the balance heuristic.
double by_rays(const Seen& seen, const std::vector<Draw>& by_fibre,
               const shading::SphericalGaussian& light, core::Random& random) {
  const glm::dvec3 axis = glm::normalize(glm::dvec3(light.axis));
  const auto sharpness = static_cast<double>(light.sharpness);
  double sum = 0;
  const auto add = [&](const Draw& draw) {
    const double of_light =
        render::pdf_sg(axis, sharpness, glm::normalize(glm::dvec3(draw.direction)));
    sum += grey(draw.scattered) * of_light / (kSamples * (of_light + draw.density));
  };
  for (const Draw& draw : by_fibre) {
    if (draw.density > 0) {
      add(draw);
    }
  }
  for (int i = 0; i < kSamples; ++i) {
    const double u1 = random.uniform_double();
    const double u2 = random.uniform_double();
    add(seen.drawn(glm::vec3(render::sample_sg(axis, sharpness, u1, u2))));
  }
  return sum;
}

std::optional<std::uint32_t> seen_segment(const render::Fabric& fabric, const glm::vec3& omega_o,
                                          core::Random& random) {
  const fabric::Tile& tile = fabric.tile();
  const float x = random.uniform() * tile.size_mm.x;
  const float y = random.uniform() * tile.size_mm.y;
  const auto hit = fabric.scene().closest({x, y, tile.z_max_mm + 0.01f}, -omega_o,
                                          std::numeric_limits<float>::infinity(), std::nullopt);
  return hit ? std::optional(hit->segment) : std::nullopt;
}

// [sharpness]: all segments, views and light directions.
std::vector<std::vector<Sent>> measure(const render::Fabric& fabric) {
  std::vector<std::vector<Sent>> sent(kSharpness.size());
  std::uint32_t stream = 0;
  for (const glm::vec3& omega_o : view_directions()) {
    for (int i = 0; i < kSegments; ++i) {
      core::Random random(21, stream++);
      const std::optional<std::uint32_t> segment = seen_segment(fabric, omega_o, random);
      if (!segment) {
        continue;
      }
      const Seen seen(fabric, *segment, omega_o);
      std::vector<Draw> by_fibre;
      for (int k = 0; k < kSamples; ++k) {
        by_fibre.push_back(seen.draw_fibre(random));
      }
      for (std::size_t s = 0; s < kSharpness.size(); ++s) {
        for (const glm::vec3& axis : light_directions()) {
          const shading::SphericalGaussian light{axis, static_cast<float>(kSharpness[s])};
          Sent one;
          one.sharpness = light.sharpness;
          one.reference = by_rays(seen, by_fibre, light, random);
          for (std::size_t k = 0; k < kSums.size(); ++k) {
            one.by_sum[k] = seen.by_sum(k, light);
          }
          for (std::size_t k = 0; k < kDistances; ++k) {
            one.by_distance[k] = seen.by_distance(k == 1, light);
          }
          sent[s].push_back(one);
        }
      }
    }
  }
  return sent;
}

// Error of the mean and root mean square error of single segments, in per cent of the mean.
template <class Value>
std::string errors(const std::vector<Sent>& sent, const Value& value) {
  double mean = 0;
  double difference = 0;
  double squared = 0;
  for (const Sent& one : sent) {
    const double off = value(one) - one.reference;
    mean += one.reference;
    difference += off;
    squared += off * off;
  }
  const auto count = static_cast<double>(sent.size());
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%+.1f / %.0f", 100 * difference / mean,
                100 * std::sqrt(squared / count) / (mean / count));
  return text.data();
}

void print_fabric(const std::string& name, const std::vector<std::vector<Sent>>& sent) {
  const auto print_row = [&](const std::string& what, const auto& value) {
    std::printf("| %s | %s |", name.c_str(), what.c_str());
    for (const std::vector<Sent>& of_sharpness : sent) {
      std::printf(" %s |", errors(of_sharpness, value).c_str());
    }
    std::printf("\n");
  };
  for (std::size_t k = 0; k < kSums.size(); ++k) {
    print_row("SSG " + std::to_string(kSums[k].count) + ", sharpness " +
                  std::to_string(static_cast<int>(kSums[k].sharpness)),
              [k](const Sent& one) { return one.by_sum[k]; });
  }
  print_row("SSDF", [](const Sent& one) { return one.by_distance[0]; });
  print_row("SSDF, not projected", [](const Sent& one) { return one.by_distance[1]; });
  for (const Blend& blend : kBlends) {
    const Gaussians& sum = kSums[blend.sum];
    const std::string of_blend = fmt::format("blend of {}, {:g} in [{:g}, {:g}]", sum.count,
                                             sum.sharpness, blend.low, blend.high);
    print_row(of_blend, [&blend](const Sent& one) {
      const auto share =
          static_cast<double>(shading::ssdf_share(one.sharpness, blend.low, blend.high));
      return (1 - share) * one.by_sum[blend.sum] + share * one.by_distance[0];
    });
  }
}

}  // namespace
}  // namespace weft::bench

int main(int count, char** arguments) {
  using namespace weft;
  std::printf("| fabric | visibility |");
  for (const double sharpness : bench::kSharpness) {
    std::printf(" SG %g |", sharpness);
  }
  std::printf("\n|---|---|");
  for (std::size_t i = 0; i < bench::kSharpness.size(); ++i) {
    std::printf("---|");
  }
  std::printf("\n");
  for (int i = 1; i < count; ++i) {
    const std::filesystem::path path(arguments[i]);
    const auto fabric = render::Fabric::from_database(storage::read_database(path),
                                                      render::Fabric::Wanted::kFibresAndTransfer);
    bench::print_fabric(path.stem().string(), bench::measure(*fabric));
  }
  return 0;
}
