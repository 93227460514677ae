#include "render/sky_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <glm/geometric.hpp>

#include "render/sphere_sampling.h"

namespace weft::render {
namespace {

// A stretch of one axis that lies in one pixel and one bin.
struct Overlap {
  std::uint32_t pixel;
  double low;  // of the axis, in [0, 1]
  double high;
};

std::vector<Overlap> overlaps(std::size_t bin, std::size_t bins, std::uint32_t pixels) {
  const double low = static_cast<double>(bin) / static_cast<double>(bins);
  const double high = static_cast<double>(bin + 1) / static_cast<double>(bins);
  std::vector<Overlap> result;
  for (auto pixel = static_cast<std::uint32_t>(low * pixels); pixel < pixels; ++pixel) {
    const double from = std::max(low, static_cast<double>(pixel) / pixels);
    const double to = std::min(high, static_cast<double>(pixel + 1) / pixels);
    if (static_cast<double>(pixel) / pixels >= high) {
      break;
    }
    if (to > from) {
      result.push_back({pixel, from, to});
    }
  }
  return result;
}

glm::dvec3 direction_at(double u, double v) {
  const double azimuth = 2 * kPi * (u - 0.5);
  const double sin_theta = std::sin(kPi * v);
  return {sin_theta * std::sin(azimuth), sin_theta * std::cos(azimuth), std::cos(kPi * v)};
}

struct Bin {
  glm::dvec3 direction;
  glm::dvec3 radiance;
  double solid_angle;
};

Bin bin_of(const Image& picture, const std::vector<Overlap>& rows,
           const std::vector<Overlap>& columns) {
  glm::dvec3 flux(0);
  double solid_angle = 0;
  for (const Overlap& row : rows) {
    const double height = std::cos(kPi * row.low) - std::cos(kPi * row.high);
    for (const Overlap& column : columns) {
      const double part = 2 * kPi * (column.high - column.low) * height;
      flux += part * glm::dvec3(picture.at(column.pixel, row.pixel));
      solid_angle += part;
    }
  }
  const glm::dvec3 middle = direction_at(0.5 * (columns.front().low + columns.back().high),
                                         0.5 * (rows.front().low + rows.back().high));
  return {middle, flux / solid_angle, solid_angle};
}

// The whole picture, as it is.
SkyGrid binned(const Image& picture) {
  SkyGrid grid;
  grid.rows = SkyGrid::kRows;
  std::vector<std::vector<Overlap>> columns;
  for (std::size_t x = 0; x < SkyGrid::kColumns; ++x) {
    columns.push_back(overlaps(x, SkyGrid::kColumns, picture.width));
  }
  for (std::size_t y = 0; y < grid.rows; ++y) {
    const std::vector<Overlap> rows = overlaps(y, SkyGrid::kRows, picture.height);
    for (const std::vector<Overlap>& across : columns) {
      const Bin bin = bin_of(picture, rows, across);
      grid.directions.emplace_back(bin.direction);
      grid.solid_angles.push_back(static_cast<float>(bin.solid_angle));
      grid.radiance.emplace_back(bin.radiance);
    }
  }
  return grid;
}

// What each bin sends is spread over the bins about it; none is lost. Bins of one row are alike but
// for their turn, so that a row's weights are computed once.
std::vector<glm::vec3> smoothed(const SkyGrid& grid) {
  constexpr std::size_t kColumns = SkyGrid::kColumns;
  struct Weight {
    std::size_t row;
    std::size_t turn;  // columns
    float share;
  };
  std::vector<glm::vec3> flux(grid.radiance.size(), glm::vec3(0));
  std::vector<Weight> weights;
  for (std::size_t row = 0; row < grid.rows; ++row) {
    const glm::vec3& from = grid.directions[row * kColumns];
    const SkyBins bins = bins_about(grid, from, SkyGrid::kSmoothing);
    weights.clear();
    float all = 0;
    for (std::size_t i = bins.first; i < bins.last; ++i) {
      const float cosine = glm::dot(grid.directions[i], from);
      if (cosine > bins.least_cosine) {
        const float share =
            grid.solid_angles[i] * std::exp(static_cast<float>(SkyGrid::kSmoothing) * (cosine - 1));
        weights.push_back({i / kColumns, i % kColumns, share});
        all += share;
      }
    }
    for (std::size_t column = 0; column < kColumns; ++column) {
      const std::size_t here = row * kColumns + column;
      const glm::vec3 sent = grid.radiance[here] * (grid.solid_angles[here] / all);
      for (const Weight& weight : weights) {
        flux[weight.row * kColumns + (column + weight.turn) % kColumns] += weight.share * sent;
      }
    }
  }
  std::vector<glm::vec3> radiance;
  for (std::size_t i = 0; i < flux.size(); ++i) {
    radiance.push_back(flux[i] / grid.solid_angles[i]);
  }
  return radiance;
}

}  // namespace

SkyGrid make_sky_grid(const Image& picture, bool upper_half) {
  SkyGrid grid = binned(picture);
  grid.radiance = smoothed(grid);
  if (upper_half) {
    grid.rows = SkyGrid::kRows / 2;
    const std::size_t bins = grid.rows * SkyGrid::kColumns;
    grid.directions.resize(bins);
    grid.solid_angles.resize(bins);
    grid.radiance.resize(bins);
  }
  for (std::size_t i = 0; i < grid.directions.size(); ++i) {
    shading::ShVector harmonics = shading::sh_evaluate(grid.directions[i]);
    for (float& value : harmonics.c) {
      value *= grid.solid_angles[i];
    }
    grid.harmonics.push_back(harmonics);
  }
  return grid;
}

SkyBins bins_about(const SkyGrid& grid, const glm::vec3& axis, double sharpness) {
  constexpr double kNegligible = 16;
  const double cos_reach = 1 - kNegligible / sharpness;
  if (cos_reach <= -1) {
    return {0, grid.rows * SkyGrid::kColumns, -2};
  }
  const double theta = std::acos(std::clamp(static_cast<double>(axis.z), -1.0, 1.0));
  const double reach = std::acos(cos_reach);
  const auto row_at = [&](double angle) {
    return static_cast<std::size_t>(
        std::clamp(angle / SkyGrid::kBin, 0.0, static_cast<double>(grid.rows)));
  };
  return {row_at(theta - reach) * SkyGrid::kColumns,
          std::min(grid.rows, row_at(theta + reach) + 1) * SkyGrid::kColumns,
          static_cast<float>(cos_reach)};
}

}  // namespace weft::render
