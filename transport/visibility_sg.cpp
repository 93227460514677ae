#include "transport/visibility_sg.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>

#include <glm/geometric.hpp>

#include "core/check.h"
#include "core/random.h"
#include "shading/visibility.h"
#include "transport/sphere.h"

namespace weft::transport {

namespace {

constexpr std::uint32_t kFullTurn = 65536;
constexpr std::size_t kWordBits = 64;

glm::vec3 direction_of(std::uint32_t row, std::uint32_t column, std::uint32_t resolution) {
  const double theta = row_theta(row, resolution);
  const double phi = column_phi(column, resolution);
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

// Pixels `first` ... `first` + 63 of a row that stands twice in `bytes`, with a word behind it.
std::uint64_t word_at(std::span<const std::uint8_t> bytes, std::size_t first) {
  std::uint64_t word = 0;
  std::memcpy(&word, &bytes[first / 8], sizeof word);
  const std::size_t shift = first % 8;
  if (shift == 0) {
    return word;
  }
  return word >> shift | std::uint64_t{bytes[first / 8 + sizeof word]} << (kWordBits - shift);
}

}  // namespace

std::uint16_t sg_rotation(std::uint64_t seed, std::uint32_t segment, std::uint32_t resolution) {
  const std::uint32_t column = core::Random(seed, segment).below(resolution);
  return static_cast<std::uint16_t>((column * kFullTurn + resolution / 2) / resolution);
}

std::vector<glm::vec3> sg_axes(std::uint32_t count, std::uint16_t rotation) {
  const float turn = static_cast<float>(rotation) * (shading::kTwoPi / 65536);
  std::vector<glm::vec3> axes;
  axes.reserve(count);
  for (std::uint32_t q = 0; q < count; ++q) {
    axes.push_back(shading::fibonacci_axis(static_cast<int>(q), static_cast<int>(count), turn));
  }
  return axes;
}

SgRegions::SgRegions(std::uint32_t count, std::uint32_t resolution)
    : count_(count),
      resolution_(resolution),
      row_words_((resolution + kWordBits - 1) / kWordBits),
      first_region_{0} {
  CHECK_GT(count, 0U);
  CHECK(resolution > 0 && resolution % 8 == 0);
  const std::vector<glm::vec3> axes = sg_axes(count, 0);
  std::vector<std::uint64_t> of_axis(count * row_words_);
  for (std::uint32_t row = 0; row < resolution / 2; ++row) {
    solid_angles_.push_back(pixel_solid_angle(row, resolution));
    std::fill(of_axis.begin(), of_axis.end(), 0);
    for (std::uint32_t column = 0; column < resolution; ++column) {
      const glm::vec3 direction = direction_of(row, column, resolution);
      std::size_t nearest = 0;
      for (std::size_t q = 1; q < axes.size(); ++q) {
        nearest = glm::dot(axes[q], direction) > glm::dot(axes[nearest], direction) ? q : nearest;
      }
      of_axis[nearest * row_words_ + column / kWordBits] |= std::uint64_t{1} << column % kWordBits;
    }
    for (std::uint32_t q = 0; q < count; ++q) {
      const auto words = std::span(of_axis).subspan(q * row_words_, row_words_);
      if (std::any_of(words.begin(), words.end(), [](std::uint64_t word) { return word != 0; })) {
        regions_.push_back({q, words_.size()});
        words_.insert(words_.end(), words.begin(), words.end());
      }
    }
    first_region_.push_back(regions_.size());
  }
}

std::vector<float> SgRegions::weights(std::span<const std::uint8_t> bits,
                                      std::uint16_t rotation) const {
  const std::size_t row_bytes = resolution_ / 8;
  CHECK_EQ(bits.size(), row_bytes * resolution_);
  const std::uint32_t columns = (rotation * resolution_ + kFullTurn / 2) / kFullTurn;
  std::vector<double> weights(count_);
  std::vector<std::uint8_t> twice(2 * row_bytes + 2 * sizeof(std::uint64_t));
  std::vector<std::uint64_t> turned(row_words_);
  for (std::size_t row = 0; row < solid_angles_.size(); ++row) {
    // The image is turned back instead of the axes.
    const auto bytes = bits.subspan(row * row_bytes, row_bytes);
    std::copy(bytes.begin(), bytes.end(), twice.begin());
    std::copy(bytes.begin(), bytes.end(), twice.begin() + static_cast<std::ptrdiff_t>(row_bytes));
    for (std::size_t w = 0; w < row_words_; ++w) {
      turned[w] = word_at(twice, columns + w * kWordBits);
    }
    for (std::size_t r = first_region_[row]; r < first_region_[row + 1]; ++r) {
      int visible = 0;
      for (std::size_t w = 0; w < row_words_; ++w) {
        visible += std::popcount(words_[regions_[r].first_word + w] & turned[w]);
      }
      weights[regions_[r].axis] += visible * solid_angles_[row];
    }
  }
  return {weights.begin(), weights.end()};
}

double open_share(std::span<const std::uint8_t> bits, std::uint32_t resolution) {
  CHECK_EQ(bits.size(), std::size_t{resolution} * resolution / 8);
  const std::size_t row_bytes = resolution / 8;
  double sum = 0;
  for (std::uint32_t row = 0; row < resolution; ++row) {
    int visible = 0;
    for (const std::uint8_t byte : bits.subspan(row * row_bytes, row_bytes)) {
      visible += std::popcount(byte);
    }
    sum += visible * pixel_solid_angle(row, resolution);
  }
  return sum / (4 * std::numbers::pi);
}

}  // namespace weft::transport
