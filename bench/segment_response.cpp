// bench_segment_response: what one fibre segment of a flat fabric sends to a fixed eye under a
// spherical Gaussian light whose axis goes around the whole sphere (Khungurn et al. 2017, figures
// 10 and 11): the truth by Monte Carlo, ours, and the schemes that the paper compares with. Prints
// one JSON value, and writes the maps side by side, the truth first, as PNG.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>

#include "core/half.h"
#include "render/baselines/light_response.h"
#include "render/baselines/low_rank_bcsdf.h"
#include "render/baselines/prt_integrator.h"
#include "render/load_fabric.h"
#include "render/png.h"
#include "render/sphere_sampling.h"
#include "transport/path.h"

namespace weft::bench {
namespace {

constexpr std::uint32_t kWidth = 192;
constexpr std::uint32_t kHeight = 96;

struct Options {
  std::string fabric;
  int figure = 11;
  float sharpness = 400;
  std::uint64_t paths = 1000000;
  std::int64_t segment = -1;
  double polar_deg = 30;
  double azimuth_deg = 30;
  std::string out;
};

struct Scheme {
  std::string name;
  render::Image map;
};

// Of the sky above the horizon, the share that a segment sees: by its weights of Gaussians, which
// are solid angles.
double share_of_sky(const storage::FabricDatabase& db, std::uint32_t segment) {
  double sum = 0;
  for (std::size_t q = 0; q < db.sg_count; ++q) {
    sum +=
        static_cast<double>(core::float_from_half(db.ssg[std::size_t{segment} * db.sg_count + q]));
  }
  return sum / (2 * render::kPi);
}

// The segment whose share is nearest to a half, partly shadowed as most that are seen, among those
// that see, well off any edge, where the reflection lobe of an eye at omega_o is highest: lobes are
// a degree wide, and most segments do not see theirs.
std::uint32_t typical_segment(const render::Fabric& fabric, const glm::vec3& omega_o) {
  constexpr float kOffEdges = 0.15f;  // radians
  const render::PrecomputedFabric& precomputed = *fabric.precomputed();
  std::uint32_t nearest = 0;
  double distance = 2;
  for (std::uint32_t k = 0; k < fabric.tile().segment_count(); ++k) {
    const glm::vec3 tangent = render::tangent_of(fabric.tile(), k);
    const glm::vec3 across = glm::vec3(0, 0, 1) - tangent.z * tangent;
    const float theta = -std::asin(std::clamp(glm::dot(tangent, omega_o), -1.0f, 1.0f));
    const glm::vec3 lobe =
        std::sin(theta) * tangent + std::cos(theta) * across / std::max(1e-6f, glm::length(across));
    const double off = std::fabs(share_of_sky(precomputed.database(), k) - 0.5);
    if (off < distance && precomputed.signed_distance(k, lobe) > kOffEdges) {
      distance = off;
      nearest = k;
    }
  }
  return nearest;
}

template <class F>
render::Image map_of(float sharpness, const F& radiance) {
  render::Image map(kWidth, kHeight);
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      map.at(x, y) = radiance(
          shading::SphericalGaussian{render::direction_of_pixel(x, y, kWidth, kHeight), sharpness});
    }
  }
  return map;
}

// Tsai and Shih's scheme: the sum over the grid's directions of what is left of S, those that the
// segment sees.
render::Image low_rank_map(const render::Fabric& fabric, std::uint32_t segment,
                           const render::ShadingPoint& at, const render::LowRankBcsdf& bcsdf,
                           float sharpness) {
  render::LightResponse response;
  for (const auto& entry : bcsdf.column(shading::fibre_angle(at.omega_o).theta)) {
    const glm::vec3 omega = glm::normalize(glm::transpose(at.to_fibre) * entry.omega_i);
    transport::Path path(fabric.scene(), fabric.bcsdfs(), segment, omega);
    if (omega.z > 0 && !path.advance()) {
      response.add(omega, entry.weight);
    }
  }
  return response.under_gaussian(sharpness, kWidth, kHeight).radiance;
}

std::vector<Scheme> figure_10(const render::Fabric& fabric, std::uint32_t segment,
                              const render::ShadingPoint& at, float sharpness) {
  const render::PrecomputedFabric& precomputed = *fabric.precomputed();
  std::vector<Scheme> schemes;
  schemes.push_back({"ours", map_of(sharpness, [&](const shading::SphericalGaussian& light) {
                       return precomputed.single_sg(at, light);
                     })});
  for (const auto& [name, rank, weighted] : {std::tuple("low rank, 16 terms", 16U, false),
                                             std::tuple("low rank, 16 terms, weighted", 16U, true),
                                             std::tuple("low rank, all terms", 0U, false)}) {
    render::LowRankSettings settings;
    settings.rank = rank;
    settings.weighted = weighted;
    const render::LowRankBcsdf bcsdf(*at.bcsdf, settings);
    schemes.push_back({name, low_rank_map(fabric, segment, at, bcsdf, sharpness)});
  }
  return schemes;
}

std::vector<Scheme> figure_11(const render::Fabric& fabric, std::uint32_t segment,
                              const render::ShadingPoint& at, const Options& options) {
  const render::PrecomputedFabric& precomputed = *fabric.precomputed();
  render::PrtSettings settings;
  settings.paths = options.paths;
  render::SegmentTransfer transfer(fabric, settings);
  const auto ours = [&](const shading::SphericalGaussian& light) {
    return precomputed.single_sg(at, light) +
           precomputed.multiple(at, render::harmonics_of_sg(light));
  };
  const auto standard = [&](const shading::SphericalGaussian& light) {
    return render::radiance_of(at, transfer.transferred(segment, render::harmonics_of_sg(light)));
  };
  return {{"ours", map_of(options.sharpness, ours)},
          {"standard PRT", map_of(options.sharpness, standard)}};
}

float largest_of(const render::Image& map) {
  float largest = 0;
  for (const glm::vec3& pixel : map.pixels) {
    largest = std::max({largest, pixel.x, pixel.y, pixel.z});
  }
  return largest;
}

double mean_square(const render::Image& map) {
  double sum = 0;
  for (const glm::vec3& pixel : map.pixels) {
    sum += glm::dot(glm::dvec3(pixel), glm::dvec3(pixel));
  }
  return sum / 3 / static_cast<double>(map.pixels.size());
}

// Brightness over all directions of the light, each by its solid angle.
double light_in_all(const render::Image& map) {
  double sum = 0;
  for (std::uint32_t y = 0; y < map.height; ++y) {
    for (std::uint32_t x = 0; x < map.width; ++x) {
      const glm::vec3& p = map.at(x, y);
      sum += static_cast<double>(p.x + p.y + p.z) * std::sin((y + 0.5) * render::kPi / map.height);
    }
  }
  return sum;
}

// Errors relative to the truth's largest value, noise of the truth taken off.
nlohmann::json judged(const Scheme& scheme, const render::LightResponse::Map& truth) {
  render::Image difference = scheme.map;
  float lowest = 0;
  for (std::size_t i = 0; i < difference.pixels.size(); ++i) {
    difference.pixels[i] -= truth.radiance.pixels[i];
    const glm::vec3& p = scheme.map.pixels[i];
    lowest = std::min({lowest, p.x, p.y, p.z});
  }
  const double largest = static_cast<double>(largest_of(truth.radiance));
  const double square = mean_square(difference) - mean_square(truth.standard_error);
  return {{"scheme", scheme.name},
          {"relative_rmse", std::sqrt(std::max(0.0, square)) / largest},
          {"energy", light_in_all(scheme.map) / light_in_all(truth.radiance)},
          {"lowest", static_cast<double>(lowest) / largest}};
}

void write_side_by_side(const std::string& path, const render::Image& truth,
                        const std::vector<Scheme>& schemes) {
  constexpr std::uint32_t kGap = 4;
  const auto count = static_cast<std::uint32_t>(schemes.size()) + 1;
  render::Image all(count * kWidth + (count - 1) * kGap, kHeight);
  for (std::uint32_t i = 0; i < count; ++i) {
    const render::Image& map = i == 0 ? truth : schemes[i - 1].map;
    for (std::uint32_t y = 0; y < kHeight; ++y) {
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        all.at(i * (kWidth + kGap) + x, y) = map.at(x, y);
      }
    }
  }
  render::write_png(path, all.width, all.height,
                    render::tone_mapped(all, render::automatic_exposure(truth)));
}

void run(const Options& options) {
  const render::LoadedFabric loaded =
      render::load_fabric(options.fabric, render::Fabric::Wanted::kFibresAndTransfer);
  const render::Fabric& fabric = *loaded.fabric;
  const storage::FabricDatabase& db = fabric.precomputed()->database();
  glm::vec3 omega_o = render::direction_of(std::cos(options.polar_deg * render::kPi / 180),
                                           options.azimuth_deg * render::kPi / 180);
  const std::uint32_t segment =
      options.segment >= 0 && options.segment < fabric.tile().segment_count()
          ? static_cast<std::uint32_t>(options.segment)
          : typical_segment(fabric, omega_o);
  const glm::vec3 tangent = render::tangent_of(fabric.tile(), segment);
  if (options.figure == 10) {
    // The eye moves to the longitude of the matrix that is nearest, by a third of a degree at most.
    const glm::mat3 frame = shading::fibre_frame(tangent, omega_o);
    const float snapped = render::nearest_theta({}, shading::fibre_angle(frame * omega_o).theta);
    omega_o =
        glm::normalize(glm::transpose(frame) * glm::vec3(std::sin(snapped), std::cos(snapped), 0));
  }
  const render::ShadingPoint at = fabric.precomputed()->point(segment, tangent, omega_o);
  render::ResponseSettings settings;
  settings.paths = options.paths;
  settings.scattering =
      options.figure == 10 ? render::Scattering::kSingleOnly : render::Scattering::kAll;
  const render::LightResponse::Map truth =
      render::measured_response(fabric, segment, omega_o, settings)
          .under_gaussian(options.sharpness, kWidth, kHeight);
  const std::vector<Scheme> schemes = options.figure == 10
                                          ? figure_10(fabric, segment, at, options.sharpness)
                                          : figure_11(fabric, segment, at, options);
  nlohmann::json results = nlohmann::json::array();
  for (const Scheme& scheme : schemes) {
    results.push_back(judged(scheme, truth));
  }
  if (!options.out.empty()) {
    write_side_by_side(options.out, truth.radiance, schemes);
  }
  const nlohmann::json answer = {
      {"fabric", loaded.name},
      {"segment", segment},
      {"share_of_sky", share_of_sky(db, segment)},
      {"truth_noise", std::sqrt(mean_square(truth.standard_error)) /
                          static_cast<double>(largest_of(truth.radiance))},
      {"schemes", results}};
  std::cout << answer.dump() << std::endl;
}

}  // namespace
}  // namespace weft::bench

int main(int argc, char** argv) {
  weft::bench::Options options;
  CLI::App app("What one fibre segment sends to the eye under lights from everywhere.");
  app.add_option("fabric", options.fabric, "Fabric database (.h5)")->required();
  app.add_option("--figure", options.figure,
                 "10: single scattering, low-rank scheme; 11: all, standard PRT")
      ->check(CLI::IsMember({10, 11}));
  app.add_option("--sharpness", options.sharpness, "Of the light")->check(CLI::Range(20.0, 1e4));
  app.add_option("--paths", options.paths, "Of the truth and of standard PRT")
      ->check(CLI::Range(1000, 1000000000));
  app.add_option("--segment", options.segment, "Default: one that sees about half of the sky");
  app.add_option("--polar", options.polar_deg, "Of the eye, degrees")->check(CLI::Range(0, 89));
  app.add_option("--azimuth", options.azimuth_deg, "Of the eye, degrees");
  app.add_option("-o,--output", options.out, "Maps side by side (.png)");
  CLI11_PARSE(app, argc, argv);
  try {
    weft::bench::run(options);
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
