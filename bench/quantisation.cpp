// Wrong signs of signed distances by how many bytes a segment's coefficients have: as many
// components in half precision, or more of them in integers, each component with a step of its own.
// Prints the table of docs/performance.md.
//   cmake --build build --target bench_quantisation
//   build/bin/bench_quantisation examples/satin_4_1.textproto ... [--paper]
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "core/half.h"
#include "core/random.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "transport/clamped_distance.h"
#include "transport/distance_fit.h"
#include "transport/pca.h"
#include "transport/signed_distance.h"
#include "transport/visibility.h"
#include "transport/visibility_raster.h"

namespace weft::bench {
namespace {

constexpr std::uint32_t kResolution = 128;
constexpr std::uint32_t kPixels = kResolution * kResolution;
constexpr std::size_t kBytes = kPixels / 8;
constexpr std::size_t kHeldOut = 400;
constexpr std::size_t kSample = 1024;

struct Layout {
  std::uint32_t components;
  int bits;  // of a coefficient; 16: a half
};
constexpr Layout kLayouts[] = {{48, 16}, {64, 12}, {96, 8}, {128, 6}, {48, 8}, {96, 16}, {192, 16}};

using Bits = std::vector<std::uint8_t>;

// Images of segments that see neither nothing nor everything, one after the other.
Bits varied_images(const fabric::Tile& tile, std::size_t count) {
  const transport::Scene scene(tile);
  const transport::VisibilityRaster raster(scene, kResolution);
  core::Random random(11, 0);
  Bits images;
  while (images.size() < count * kBytes) {
    const Bits bits = raster.bits(random.below(tile.segment_count()));
    const bool is_varied = std::any_of(bits.begin(), bits.end(),
                                       [&](std::uint8_t byte) { return byte != bits.front(); });
    if (is_varied) {
      images.insert(images.end(), bits.begin(), bits.end());
    }
  }
  return images;
}

std::vector<float> distances_of(const Bits& images) {
  const transport::ClampedDistances clamped(kResolution);
  std::vector<float> all(images.size() * 8);
  for (std::size_t at = 0; at < images.size(); at += kBytes) {
    clamped.measure(std::span(images).subspan(at, kBytes), std::span(all).subspan(8 * at, kPixels));
  }
  return all;
}

// Share of the pixels next to which, to the right or below, the sky ends or begins.
double edge_share(const Bits& images) {
  std::uint64_t edges = 0;
  for (std::size_t at = 0; at < images.size(); at += kBytes) {
    const auto image = std::span(images).subspan(at, kBytes);
    for (std::uint32_t p = 0; p < kPixels; ++p) {
      const std::uint32_t right = p / kResolution * kResolution + (p + 1) % kResolution;
      const std::uint32_t below = std::min(p + kResolution, kPixels - 1);
      const bool here = transport::is_visible(image, p);
      const bool is_edge =
          here != transport::is_visible(image, right) ||
          (p + kResolution < kPixels && here != transport::is_visible(image, below));
      edges += is_edge ? 1 : 0;
    }
  }
  return static_cast<double>(edges) / static_cast<double>(8 * images.size());
}

// Each component's largest value in `sample` [images, components] is the largest integer.
void quantise(const std::vector<float>& sample, const Layout& layout, std::vector<float>& values) {
  const auto largest_integer = static_cast<float>((1 << (layout.bits - 1)) - 1);
  for (std::size_t c = 0; c < layout.components; ++c) {
    float largest = 0;
    for (std::size_t i = c; i < sample.size(); i += layout.components) {
      largest = std::max(largest, std::abs(sample[i]));
    }
    const float step = largest / largest_integer;
    for (std::size_t i = c; i < values.size(); i += layout.components) {
      values[i] =
          std::clamp(std::round(values[i] / step), -largest_integer, largest_integer) * step;
    }
  }
}

double wrong_share(const Bits& sample, const Bits& held_out, const Layout& layout) {
  std::vector<float> distances = distances_of(sample);
  const transport::DistanceBasis basis =
      transport::principal_components(distances, kPixels, layout.components, 7);
  const transport::DistanceFit fit(basis, kResolution);
  std::vector<float> coefficients = fit.coefficients(held_out);
  if (layout.bits == 16) {
    for (float& c : coefficients) {
      c = core::float_from_half(core::half_from_float(c));
    }
  } else {
    quantise(fit.coefficients(sample), layout, coefficients);
  }
  return static_cast<double>(transport::wrong_signs(basis, held_out, coefficients)) /
         static_cast<double>(8 * held_out.size());
}

void print_row(const std::string& name, const fabric::Tile& tile) {
  const Bits images = varied_images(tile, kHeldOut + kSample);
  const auto middle = images.begin() + static_cast<std::ptrdiff_t>(kHeldOut * kBytes);
  const Bits held_out(images.begin(), middle);
  const Bits sample(middle, images.end());
  fmt::print("| {} | {:.1f} % |", name, 100 * edge_share(images));
  for (const Layout& layout : kLayouts) {
    fmt::print(" {:.2f} % |", 100 * wrong_share(sample, held_out, layout));
    std::fflush(stdout);
  }
  fmt::print("\n");
}

}  // namespace
}  // namespace weft::bench

int main(int count, char** arguments) {
  std::vector<std::string> paths(arguments + 1, arguments + count);
  const bool paper = std::erase(paths, "--paper") > 0;
  fmt::print("| fabric | pixels at edges |");
  std::string rule = "|---|---|";
  for (const weft::bench::Layout& layout : weft::bench::kLayouts) {
    fmt::print(" {} of {} bits, {} B |", layout.components, layout.bits,
               layout.components * static_cast<unsigned>(layout.bits) / 8);
    rule += "---|";
  }
  fmt::print("\n{}\n", rule);
  for (const std::string& path : paths) {
    weft::bench::print_row(std::filesystem::path(path).stem().string(),
                           weft::fabric::build_tile(weft::fabric::load_description(
                               path, paper ? weft::v1::QUALITY_PAPER : weft::v1::QUALITY_PREVIEW)));
  }
  return 0;
}
