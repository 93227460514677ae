#include "core/sobol.h"

#include <bit>

namespace weft::core {

namespace {

constexpr std::uint32_t kPurpose = 0x736f626f;  // "sobo"
constexpr std::size_t kBits = 32;
using Directions = std::array<std::uint32_t, kBits>;

// The primitive polynomial of a dimension and its first direction numbers.
struct Polynomial {
  unsigned degree;
  unsigned inner;  // coefficients between the first and the last
  std::array<std::uint32_t, 4> first;
};

// Dimensions 2 to 6 of the table new-joe-kuo-6.21201.
constexpr std::array<Polynomial, SobolPoints::kDimensions - 1> kPolynomials{{
    {1, 0, {1, 0, 0, 0}},
    {2, 1, {1, 3, 0, 0}},
    {3, 1, {1, 3, 1, 0}},
    {3, 2, {1, 1, 1, 0}},
    {4, 1, {1, 1, 3, 3}},
}};

constexpr Directions directions_of(const Polynomial& p) {
  Directions v{};
  for (unsigned k = 0; k < kBits; ++k) {
    if (k < p.degree) {
      v[k] = p.first[k] << (31 - k);
      continue;
    }
    v[k] = v[k - p.degree] ^ (v[k - p.degree] >> p.degree);
    for (unsigned j = 1; j < p.degree; ++j) {
      if (((p.inner >> (p.degree - 1 - j)) & 1U) != 0) {
        v[k] ^= v[k - j];
      }
    }
  }
  return v;
}

constexpr std::array<Directions, SobolPoints::kDimensions> all_directions() {
  std::array<Directions, SobolPoints::kDimensions> all{};
  for (unsigned k = 0; k < kBits; ++k) {
    all[0][k] = 0x80000000U >> k;
  }
  for (std::size_t d = 1; d < all.size(); ++d) {
    all[d] = directions_of(kPolynomials[d - 1]);
  }
  return all;
}

constexpr std::array<Directions, SobolPoints::kDimensions> kDirections = all_directions();

constexpr std::uint32_t reversed(std::uint32_t x) {
  x = ((x >> 1) & 0x55555555U) | ((x & 0x55555555U) << 1);
  x = ((x >> 2) & 0x33333333U) | ((x & 0x33333333U) << 2);
  x = ((x >> 4) & 0x0f0f0f0fU) | ((x & 0x0f0f0f0fU) << 4);
  x = ((x >> 8) & 0x00ff00ffU) | ((x & 0x00ff00ffU) << 8);
  return (x >> 16) | (x << 16);
}

// Each bit is flipped by a hash of the seed and of the bits above it.
constexpr std::uint32_t scrambled(std::uint32_t x, std::uint32_t seed) {
  x = reversed(x);
  x += seed;
  x ^= x * 0x6c50b47cU;
  x ^= x * 0xb82f1e52U;
  x ^= x * 0xc7afe638U;
  x ^= x * 0x8d22f6e6U;
  return reversed(x);
}

}  // namespace

SobolPoints::SobolPoints(std::uint64_t seed, std::uint32_t stream) {
  Random random(derive_seed(seed, kPurpose), stream);
  for (std::uint32_t& own : seeds_) {
    own = random.bits();
  }
}

SobolPoints::Point SobolPoints::point(std::uint32_t index) const {
  Point point{};
  for (std::uint32_t rest = index; rest != 0; rest &= rest - 1) {
    const auto bit = static_cast<std::size_t>(std::countr_zero(rest));
    for (std::size_t d = 0; d < kDimensions; ++d) {
      point[d] ^= kDirections[d][bit];
    }
  }
  for (std::size_t d = 0; d < kDimensions; ++d) {
    point[d] = scrambled(point[d], seeds_[d]);
  }
  return point;
}

}  // namespace weft::core
