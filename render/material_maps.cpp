#include "render/material_maps.h"

#include <array>
#include <atomic>
#include <cmath>
#include <mutex>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "core/check.h"
#include "core/error.h"
#include "core/random.h"
#include "render/map_sample.h"
#include "render/sheen_fit.h"
#include "render/surface_lobe.h"

namespace weft::render {
namespace {

constexpr std::uint32_t kPurposeOfMaps = 0x6d617073;   // "maps"
constexpr std::uint32_t kPurposeOfSheen = 0x7368656e;  // "shen"
constexpr glm::vec3 kLuminance(0.2126f, 0.7152f, 0.0722f);

// What the samples of one pixel add up to.
struct PixelSums {
  std::uint32_t hits = 0;
  glm::dvec3 albedo{0};
  glm::dvec3 normal{0};
  glm::dvec3 reflection{0};
  double z_mm = 0;
  double transmission = 0;
  // Of the normals' x and y, and of what a lobe of width beta_R adds along the fibre: a normal that
  // tilts by d turns what it reflects by 2 d.
  double xx = 0;
  double xy = 0;
  double yy = 0;

  void add(const MapSample& sample) {
    ++hits;
    albedo += sample.albedo;
    normal += sample.normal;
    z_mm += static_cast<double>(sample.z_mm);
    const shading::FibreMaterial& material = sample.bcsdf->material();
    reflection += sample.reflected;
    const double tilt = 0.25 * static_cast<double>(material.beta_r * material.beta_r);
    const glm::dvec3 n(sample.normal);
    const glm::dvec3 t(sample.tangent);
    xx += n.x * n.x + tilt * t.x * t.x;
    xy += n.x * n.y + tilt * t.x * t.y;
    yy += n.y * n.y + tilt * t.y * t.y;
  }
};

class MapBaker {
 public:
  MapBaker(const Fabric& fabric, const MapSettings& settings)
      : settings_(settings),
        eye_(fabric),
        side_(static_cast<std::uint32_t>(std::ceil(std::sqrt(settings.samples)))) {
    const std::size_t pixels = std::size_t{settings.width} * settings.height;
    maps_.width = settings.width;
    maps_.height = settings.height;
    maps_.size_mm = fabric.tile().size_mm;
    maps_.z_bounds_mm = {fabric.tile().z_min_mm, fabric.tile().z_max_mm};
    maps_.base_colour.resize(pixels);
    maps_.normal.resize(pixels, glm::vec3(0, 0, 1));
    maps_.height_mm.resize(pixels, maps_.z_bounds_mm.x);
    maps_.roughness.resize(pixels, 1);
    maps_.across.resize(pixels, glm::vec2(1, 0));
    maps_.anisotropy.resize(pixels);
    maps_.transmission.resize(pixels);
    maps_.coverage.resize(pixels);
    reflections_.resize(settings.height);
    hits_.resize(settings.height);
  }

  void bake_row(std::uint32_t row) {
    for (std::uint32_t column = 0; column < settings_.width; ++column) {
      const PixelSums sums = look_at(row, column);
      reflections_[row] += sums.reflection;
      hits_[row] += sums.hits;
      put(std::size_t{row} * settings_.width + column, sums);
    }
  }

  MaterialMaps finish() {
    glm::dvec3 reflection(0);
    std::uint64_t hits = 0;
    for (std::uint32_t row = 0; row < settings_.height; ++row) {
      reflection += reflections_[row];
      hits += hits_[row];
    }
    maps_.reflection =
        glm::min(glm::vec3(reflection / std::max(1.0, static_cast<double>(hits))), glm::vec3(1));
    fill_gaps();
    const Sheen sheen = fit_sheen(views());
    maps_.sheen_colour = glm::vec3(sheen.colour);
    maps_.sheen_roughness = static_cast<float>(sheen.roughness);
    return std::move(maps_);
  }

 private:
  [[nodiscard]] PixelSums look_at(std::uint32_t row, std::uint32_t column) const {
    const std::uint64_t seed = core::derive_seed(settings_.seed, kPurposeOfMaps);
    const std::uint32_t pixel = row * settings_.width + column;
    PixelSums sums;
    for (std::uint32_t s = 0; s < settings_.samples; ++s) {
      core::Random random(seed, pixel, s);
      const std::uint32_t row_of_strata = s / side_;
      // Strata of a square grid; where samples are no square number, the last ones stay empty.
      const glm::vec2 stratum(static_cast<float>(s % side_), static_cast<float>(row_of_strata));
      const float jitter_x = random.uniform();
      const glm::vec2 within =
          (stratum + glm::vec2(jitter_x, random.uniform())) / static_cast<float>(side_);
      // The top row has the greatest y.
      const glm::vec2 share = (glm::vec2(column, settings_.height - 1 - row) + within) /
                              glm::vec2(settings_.width, settings_.height);
      const glm::vec2 at_mm = share * maps_.size_mm;
      if (const std::optional<MapSample> sample = eye_.look(at_mm, glm::vec3(0, 0, 1))) {
        sums.add(*sample);
        sums.transmission +=
            static_cast<double>(glm::dot(kLuminance, eye_.from_below(at_mm, random)));
      } else {
        sums.z_mm += static_cast<double>(maps_.z_bounds_mm.x);
      }
    }
    return sums;
  }

  void put(std::size_t at, const PixelSums& sums) {
    maps_.coverage[at] = static_cast<float>(sums.hits) / static_cast<float>(settings_.samples);
    maps_.height_mm[at] = static_cast<float>(sums.z_mm / settings_.samples);
    if (sums.hits == 0) {
      return;
    }
    const double n = sums.hits;
    const glm::dvec3 mean = sums.normal / n;
    maps_.base_colour[at] = glm::max(glm::vec3(sums.albedo / n), glm::vec3(0));
    maps_.normal[at] = glm::vec3(glm::normalize(mean));
    maps_.transmission[at] = static_cast<float>(sums.transmission / n);
    const SurfaceLobe lobe =
        surface_lobe(sums.xx / n - mean.x * mean.x, sums.xy / n - mean.x * mean.y,
                     sums.yy / n - mean.y * mean.y);
    maps_.roughness[at] = lobe.roughness;
    maps_.anisotropy[at] = lobe.anisotropy;
    maps_.across[at] = lobe.across;
  }

  // Where nothing is seen pictures are looked up all the same, between pixels: the mean stands
  // there.
  void fill_gaps() {
    glm::dvec3 colour(0);
    double roughness = 0;
    double transmission = 0;
    double covered = 0;
    for (std::size_t i = 0; i < maps_.coverage.size(); ++i) {
      const auto weight = static_cast<double>(maps_.coverage[i]);
      colour += weight * glm::dvec3(maps_.base_colour[i]);
      roughness += weight * static_cast<double>(maps_.roughness[i]);
      transmission += weight * static_cast<double>(maps_.transmission[i]);
      covered += weight;
    }
    for (std::size_t i = 0; i < maps_.coverage.size() && covered > 0; ++i) {
      if (maps_.coverage[i] == 0) {
        maps_.base_colour[i] = glm::vec3(colour / covered);
        maps_.roughness[i] = static_cast<float>(roughness / covered);
        maps_.transmission[i] = static_cast<float>(transmission / covered);
      }
    }
  }

  // The whole tile from several heights, each from all sides.
  [[nodiscard]] std::vector<SkyAlbedo> views() const {
    constexpr std::array<double, 6> kDegrees = {0, 30, 50, 65, 75, 82};
    constexpr std::uint32_t kLooks = 1024;
    constexpr double kRadian = 0.017453292519943295;
    const std::uint64_t seed = core::derive_seed(settings_.seed, kPurposeOfSheen);
    std::vector<SkyAlbedo> views;
    for (std::uint32_t view = 0; view < kDegrees.size(); ++view) {
      SkyAlbedo seen{kRadian * kDegrees[view], glm::dvec3(0)};
      double hits = 0;
      for (std::uint32_t i = 0; i < kLooks; ++i) {
        core::Random random(seed, view, i);
        const double phi = 360 * kRadian * random.uniform_double();
        const float x = random.uniform();
        const glm::vec2 at_mm = glm::vec2(x, random.uniform()) * maps_.size_mm;
        const glm::dvec3 eye(std::sin(seen.theta) * std::cos(phi),
                             std::sin(seen.theta) * std::sin(phi), std::cos(seen.theta));
        if (const std::optional<MapSample> sample = eye_.look(at_mm, glm::vec3(eye))) {
          seen.albedo += sample->albedo;
          ++hits;
        }
      }
      seen.albedo /= std::max(1.0, hits);
      views.push_back(seen);
    }
    return views;
  }

  MapSettings settings_;
  MapEye eye_;
  std::uint32_t side_;
  MaterialMaps maps_;
  std::vector<glm::dvec3> reflections_;  // [height], folded in the order of rows
  std::vector<std::uint64_t> hits_;
};

}  // namespace

MaterialMaps bake_maps(const Fabric& fabric, const MapSettings& settings,
                       const std::function<void(double)>& progress,
                       const std::function<bool()>& should_stop) {
  CHECK(settings.width > 0 && settings.height > 0 && settings.samples > 0);
  MapBaker baker(fabric, settings);
  std::atomic<bool> stopped = false;
  std::mutex mutex;
  std::uint32_t done = 0;
  tbb::task_arena arena(settings.threads == 0 ? tbb::task_arena::automatic
                                              : static_cast<int>(settings.threads));
  arena.execute([&] {
    tbb::parallel_for(std::uint32_t{0}, settings.height, [&](std::uint32_t row) {
      if (stopped) {
        return;
      }
      baker.bake_row(row);
      const std::lock_guard lock(mutex);
      stopped = stopped || should_stop();
      progress(static_cast<double>(++done) / settings.height);
    });
  });
  if (stopped) {
    throw core::Error(core::Code::kCancelled, "stopped; nothing was written");
  }
  return baker.finish();
}

}  // namespace weft::render
