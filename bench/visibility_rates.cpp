// What visibility, signed distances and their coefficients cost, and whether they are right: one
// thread, CPU time, on a seeded choice of a fabric's segments.
//   cmake --build build --target bench_visibility_rates
//   build/bin/bench_visibility_rates examples/satin_4_1.textproto ... [--paper]
// Each row compares the raster's bits with those of rays, ours and Embree's, on a million pixels,
// the wide path's with the portable one's, distances with brute force and the fitted coefficients
// with projections. Exits with 1 when a check fails.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <sys/resource.h>

#include "core/half.h"
#include "core/random.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "transport/clamped_distance.h"
#include "transport/distance_fit.h"
#include "transport/embree_scene.h"
#include "transport/pca.h"
#include "transport/signed_distance.h"
#include "transport/sphere.h"
#include "transport/visibility.h"
#include "transport/visibility_raster.h"

namespace weft::bench {
namespace {

constexpr std::uint32_t kResolution = 128;
constexpr std::uint32_t kPixels = kResolution * kResolution;
constexpr std::size_t kBytes = kPixels / 8;
constexpr std::uint32_t kComponents = 48;
constexpr std::uint32_t kByRays = 62;     // segments: a million pixels
constexpr std::uint32_t kSegments = 600;  // whose coefficients are held out
constexpr std::uint32_t kSample = 1024;   // of which the basis is made
constexpr std::uint32_t kGrazing = 2;     // pixels of a million that rounding may turn
constexpr double kDistanceError = 5e-6;

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

// CPU milliseconds of each of `count` calls.
double time_each(std::uint32_t count, const std::function<void(std::uint32_t)>& call) {
  const double start = cpu_seconds();
  for (std::uint32_t i = 0; i < count; ++i) {
    call(i);
  }
  return 1000 * (cpu_seconds() - start) / count;
}

using Bits = std::vector<std::uint8_t>;

std::uint64_t differing(const Bits& a, const Bits& b) {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    count += static_cast<std::uint64_t>(std::popcount(static_cast<unsigned>(a[i] ^ b[i])));
  }
  return count;
}

bool is_varied(const Bits& bits) {
  const auto all_are = [&](unsigned value) {
    return std::all_of(bits.begin(), bits.end(), [&](unsigned byte) { return byte == value; });
  };
  return !all_are(0x00) && !all_are(0xff);
}

// Largest error of every 61st pixel's distance.
double distance_error(const Bits& bits, const std::vector<float>& distances) {
  std::vector<glm::dvec3> direction(kPixels);
  for (std::uint32_t p = 0; p < kPixels; ++p) {
    const double theta = transport::row_theta(p / kResolution, kResolution);
    const double phi = transport::column_phi(p % kResolution, kResolution);
    direction[p] = {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                    std::cos(theta)};
  }
  double worst = 0;
  for (std::uint32_t p = 0; p < kPixels; p += 61) {
    double nearest = 4;
    for (std::uint32_t q = 0; q < kPixels; ++q) {
      if (transport::is_visible(bits, p) != transport::is_visible(bits, q)) {
        const glm::dvec3 chord = direction[p] - direction[q];
        const double half =
            0.5 * std::sqrt(chord.x * chord.x + chord.y * chord.y + chord.z * chord.z);
        nearest = std::min(nearest, 2 * std::asin(std::min(1.0, half)));
      }
    }
    worst = std::max(worst, std::abs(nearest - std::abs(static_cast<double>(distances[p]))));
  }
  return worst;
}

struct Row {
  std::uint32_t segments = 0;
  double by_rays_ms = 0;
  double by_raster_ms = 0;
  double portable_ms = 0;
  std::uint64_t grazing = 0;            // pixels that differ from Scene's rays
  std::uint64_t grazing_by_embree = 0;  // from Embree's
  double distance_ms = 0;
  double distance_error = 0;
  double blocked = 0;
  double fit_ms = 0;  // of a segment that sees something, its distances included
  double basis_s = 0;
  double projected = 0;  // share of wrong signs
  double fitted = 0;
  bool same = true;  // wide and portable
};

void round_to_halves(std::vector<float>& values) {
  for (float& value : values) {
    value = core::float_from_half(core::half_from_float(value));
  }
}

std::vector<float> clamped(const Bits& bits) {
  static const transport::ClampedDistances distances(kResolution);
  std::vector<float> image(kPixels);
  distances.measure(bits, image);
  return image;
}

// All that comes after the bits.
void measure_distances(const std::vector<Bits>& images, Row& row) {
  std::vector<Bits> varied;
  std::copy_if(images.begin(), images.end(), std::back_inserter(varied), is_varied);
  row.blocked = 1 - static_cast<double>(varied.size()) / static_cast<double>(images.size());
  const auto held_out = static_cast<std::uint32_t>(varied.size() * kSegments / images.size());
  const auto some = static_cast<std::uint32_t>(varied.size());

  const transport::DistanceTransform transform(kResolution);
  std::vector<float> distances(kPixels);
  row.distance_ms =
      time_each(some, [&](std::uint32_t i) { transform.measure(varied[i], distances); });
  transform.measure(varied[0], distances);
  row.distance_error = distance_error(varied[0], distances);

  std::vector<float> sample;
  for (std::uint32_t i = held_out; i < some; ++i) {
    const std::vector<float> image = clamped(varied[i]);
    sample.insert(sample.end(), image.begin(), image.end());
  }
  transport::DistanceBasis basis;
  row.basis_s = time_each(1,
                          [&](std::uint32_t) {
                            basis =
                                transport::principal_components(sample, kPixels, kComponents, 7);
                          }) /
                1000;

  Bits all;
  std::vector<float> projected;
  for (std::uint32_t i = 0; i < held_out; ++i) {
    all.insert(all.end(), varied[i].begin(), varied[i].end());
    const std::vector<float> c = transport::project(basis, clamped(varied[i]));
    projected.insert(projected.end(), c.begin(), c.end());
  }
  const transport::DistanceFit fit(basis, kResolution);
  std::vector<float> fitted;
  row.fit_ms = time_each(1, [&](std::uint32_t) { fitted = fit.coefficients(all); }) / held_out;
  setenv("WEFT_PORTABLE", "1", 1);
  row.same = row.same && transport::DistanceFit(basis, kResolution).coefficients(all) == fitted;
  unsetenv("WEFT_PORTABLE");
  round_to_halves(projected);
  round_to_halves(fitted);
  const double compared = static_cast<double>(held_out) * kPixels;
  row.projected = static_cast<double>(transport::wrong_signs(basis, all, projected)) / compared;
  row.fitted = static_cast<double>(transport::wrong_signs(basis, all, fitted)) / compared;
}

Row measure(const fabric::Tile& tile) {
  Row row;
  row.segments = tile.segment_count();
  const transport::Scene scene(tile);
  const transport::EmbreeScene embree(tile);
  const transport::VisibilityRaster raster(scene, kResolution);
  const auto segment = [&](std::uint32_t i) {
    return core::Random(11, 0, i).below(tile.segment_count());
  };
  std::vector<Bits> rays(kByRays);
  row.by_rays_ms = time_each(kByRays, [&](std::uint32_t i) {
    rays[i] = transport::visibility_bits(scene, segment(i), kResolution);
  });
  constexpr std::uint32_t kAll = kSegments + kSample;
  std::vector<Bits> images(kAll);
  row.by_raster_ms = time_each(kAll, [&](std::uint32_t i) { images[i] = raster.bits(segment(i)); });
  setenv("WEFT_PORTABLE", "1", 1);
  row.portable_ms = time_each(kSegments, [&](std::uint32_t i) {
    row.same = raster.bits(segment(i)) == images[i] && row.same;
  });
  unsetenv("WEFT_PORTABLE");
  for (std::uint32_t i = 0; i < kByRays; ++i) {
    row.grazing += differing(rays[i], images[i]);
    row.grazing_by_embree +=
        differing(transport::visibility_bits(scene, embree, segment(i), kResolution), images[i]);
  }
  measure_distances(images, row);
  return row;
}

bool print(const std::string& name, const Row& row) {
  const bool right = row.grazing <= kGrazing && row.grazing_by_embree <= kGrazing && row.same &&
                     row.distance_error <= kDistanceError && row.fitted <= row.projected;
  const double each_ms = row.by_raster_ms + (1 - row.blocked) * row.fit_ms;
  std::printf(
      "| %s | %u | %.2f | %.3f | %.3f | %.1f | %llu, %llu | %.3f | %.1e | %.0f %% | %.3f | %.3f | "
      "%.0f | %.2f | %.2f %% | %.2f %% | %s |\n",
      name.c_str(), row.segments, row.by_rays_ms, row.by_raster_ms, row.portable_ms,
      row.by_rays_ms / row.by_raster_ms, static_cast<unsigned long long>(row.grazing),
      static_cast<unsigned long long>(row.grazing_by_embree), row.distance_ms, row.distance_error,
      100 * row.blocked, row.fit_ms, each_ms, 1000 / each_ms, row.basis_s, 100 * row.projected,
      100 * row.fitted, right ? "yes" : "NO");
  std::fflush(stdout);
  return right;
}

}  // namespace
}  // namespace weft::bench

int main(int count, char** arguments) {
  using namespace weft;
  std::vector<std::string> paths(arguments + 1, arguments + count);
  const bool paper = std::erase(paths, "--paper") > 0;
  std::printf(
      "| fabric | segments | rays, ms | raster, ms | portable, ms | rays / raster | other pixels "
      "of a million, Embree's | distances, ms | error, rad | uniform | coefficients, ms | bits and "
      "coefficients, ms | segments per s | basis, s | wrong signs, projected | fitted | right "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  bool right = true;
  for (const std::string& path : paths) {
    const fabric::Tile tile = fabric::build_tile(
        fabric::load_description(path, paper ? v1::QUALITY_PAPER : v1::QUALITY_PREVIEW));
    right =
        bench::print(std::filesystem::path(path).stem().string(), bench::measure(tile)) && right;
  }
  return right ? 0 : 1;
}
