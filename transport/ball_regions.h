#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <glm/vec3.hpp>

#include "transport/cover_mask.h"

namespace weft::transport {

// Balls that are looked at together, one in each lane of a vector register.
struct Balls {
  static constexpr std::size_t kCount = 16;
  alignas(64) std::array<float, kCount> x{};
  alignas(64) std::array<float, kCount> y{};
  alignas(64) std::array<float, kCount> z{};
  alignas(64) std::array<float, kCount> radius{};
};

// For each ball a region that holds all pixels whose centres it may hide from the origin: the whole
// image where it holds the origin.
struct BallRegions {
  alignas(64) std::array<float, Balls::kCount> distance2{};  // of the centre from the origin
  alignas(64) std::array<std::int32_t, Balls::kCount> first_row{};
  alignas(64) std::array<std::int32_t, Balls::kCount> last_row{};
  alignas(64) std::array<std::int32_t, Balls::kCount> first_column{};
  alignas(64) std::array<std::int32_t, Balls::kCount> last_column{};

  [[nodiscard]] ImageRegion region(std::size_t lane) const {
    return {first_row[lane], last_row[lane], first_column[lane], last_column[lane]};
  }
};

// The regions of balls moved by `shift`. `wide`: wide_is_available() said yes; a region may then
// differ in its margin, which is more than rounding anyway.
void bound(const Balls& balls, glm::vec3 shift, std::uint32_t resolution, bool wide,
           BallRegions& regions);

}  // namespace weft::transport
