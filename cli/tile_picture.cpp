#include "cli/tile_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "core/check.h"

namespace weft::cli {

namespace {

constexpr std::uint32_t kSamples = 2;  // per pixel and direction
constexpr std::uint32_t kShadowSide = 1536;
constexpr float kShadowBiasRadii = 1.5F;
constexpr glm::vec3 kBackground{0.9F, 0.9F, 0.9F};

// A raster that looks along -z of its own frame: x to the right, y up.
struct Raster {
  glm::mat3 rotation{1};  // cloth to raster, in millimetres
  glm::vec2 centre_mm{0};
  float pixels_per_mm = 1;
  std::uint32_t width = 0;
  std::uint32_t height = 0;

  [[nodiscard]] glm::vec3 project(glm::vec3 cloth_mm) const {
    const glm::vec3 p = rotation * cloth_mm;
    return {(p.x - centre_mm.x) * pixels_per_mm + 0.5F * static_cast<float>(width),
            0.5F * static_cast<float>(height) - (p.y - centre_mm.y) * pixels_per_mm, p.z};
  }
};

struct Hit {
  float depth = std::numeric_limits<float>::lowest();  // z of the raster's frame, millimetres
  std::uint32_t segment = 0;
  glm::vec3 normal{0};  // in the cloth's frame
  glm::vec3 place{0};
};

struct Piece {
  glm::vec3 a;
  glm::vec3 b;
  float radius_mm;
  std::uint32_t segment;
};

// Calls visit(x, y, depth, share, across) for every sample whose ray meets the piece's ribbon:
// `share` along the piece, `across` from -1 to 1.
template <class Visit>
void rasterise(const Raster& raster, const Piece& piece, const Visit& visit) {
  const glm::vec3 a = raster.project(piece.a);
  const glm::vec3 b = raster.project(piece.b);
  const float radius = std::max(piece.radius_mm * raster.pixels_per_mm, 0.5F);
  const auto clip = [](float value, std::uint32_t side) {
    return static_cast<int>(std::clamp(value, 0.0F, static_cast<float>(side)));
  };
  const int x_from = clip(std::floor(std::min(a.x, b.x) - radius), raster.width);
  const int x_to = clip(std::ceil(std::max(a.x, b.x) + radius), raster.width);
  const int y_from = clip(std::floor(std::min(a.y, b.y) - radius), raster.height);
  const int y_to = clip(std::ceil(std::max(a.y, b.y) + radius), raster.height);
  const glm::vec2 along{b.x - a.x, b.y - a.y};
  const float length2 = std::max(glm::dot(along, along), 1e-12F);
  for (int y = y_from; y < y_to; ++y) {
    for (int x = x_from; x < x_to; ++x) {
      const glm::vec2 p{static_cast<float>(x) + 0.5F - a.x, static_cast<float>(y) + 0.5F - a.y};
      const float share = std::clamp(glm::dot(p, along) / length2, 0.0F, 1.0F);
      const glm::vec2 away = p - along * share;
      const float distance2 = glm::dot(away, away);
      if (distance2 >= radius * radius) {
        continue;
      }
      const float across = std::sqrt(distance2) / radius;
      const float rise = piece.radius_mm * std::sqrt(1 - across * across);
      visit(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y),
            a.z + (b.z - a.z) * share + rise, share, away / radius);
    }
  }
}

// Calls draw(piece) for every copy of every segment that may show in the raster.
template <class Draw>
void for_each_copy(const fabric::Tile& tile, const Raster& raster, const Draw& draw) {
  // The cloth's rectangle that the raster can see: its corners taken back at both heights.
  glm::vec2 low{std::numeric_limits<float>::max()};
  glm::vec2 high{std::numeric_limits<float>::lowest()};
  const glm::mat3 back = glm::transpose(raster.rotation);
  const glm::vec3 sight = back * glm::vec3(0, 0, 1);
  for (const float sx : {-0.5F, 0.5F}) {
    for (const float sy : {-0.5F, 0.5F}) {
      const glm::vec3 corner =
          back *
          glm::vec3(
              raster.centre_mm.x + sx * static_cast<float>(raster.width) / raster.pixels_per_mm,
              raster.centre_mm.y + sy * static_cast<float>(raster.height) / raster.pixels_per_mm,
              0);
      for (const float z : {tile.z_min_mm, tile.z_max_mm}) {
        const glm::vec3 at = corner + sight * ((z - corner.z) / sight.z);
        low = glm::min(low, glm::vec2(at));
        high = glm::max(high, glm::vec2(at));
      }
    }
  }
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const fabric::Segment s = tile.segment(k);
    const glm::vec2 from = glm::min(glm::vec2(s.a_mm), glm::vec2(s.b_mm)) - s.radius_mm;
    const glm::vec2 to = glm::max(glm::vec2(s.a_mm), glm::vec2(s.b_mm)) + s.radius_mm;
    const glm::ivec2 first{glm::ceil((low - to) / tile.size_mm)};
    const glm::ivec2 last{glm::floor((high - from) / tile.size_mm)};
    for (int j = first.y; j <= last.y; ++j) {
      for (int i = first.x; i <= last.x; ++i) {
        const glm::vec3 shift{static_cast<float>(i) * tile.size_mm.x,
                              static_cast<float>(j) * tile.size_mm.y, 0};
        draw(Piece{s.a_mm + shift, s.b_mm + shift, s.radius_mm, k});
      }
    }
  }
}

glm::mat3 look_along(glm::vec3 to_viewer, float turn) {
  const glm::vec3 forward = glm::normalize(to_viewer);
  const glm::vec3 up_hint{-std::sin(turn), std::cos(turn), 0};
  const glm::vec3 right = glm::normalize(glm::cross(up_hint, forward));
  return glm::transpose(glm::mat3(right, glm::cross(forward, right), forward));
}

std::vector<Hit> find_hits(const fabric::Tile& tile, const Raster& raster) {
  std::vector<Hit> hits(static_cast<std::size_t>(raster.width) * raster.height);
  const glm::mat3 back = glm::transpose(raster.rotation);
  for_each_copy(tile, raster, [&](const Piece& piece) {
    const glm::vec3 along = piece.b - piece.a;
    const glm::vec3 tangent = along / std::max(glm::length(along), 1e-12F);
    rasterise(raster, piece,
              [&](std::uint32_t x, std::uint32_t y, float depth, float share, glm::vec2 away) {
                Hit& hit = hits[static_cast<std::size_t>(y) * raster.width + x];
                if (depth <= hit.depth) {
                  return;
                }
                const float out = std::sqrt(std::max(0.0F, 1 - glm::dot(away, away)));
                glm::vec3 normal = back * glm::vec3(away.x, -away.y, out);
                normal -= tangent * glm::dot(normal, tangent);
                hit = {depth, piece.segment, normal / std::max(glm::length(normal), 1e-6F),
                       piece.a + along * share + normal * piece.radius_mm};
              });
  });
  return hits;
}

// Depths from the light over the piece of cloth that the view shows.
struct ShadowMap {
  Raster raster;
  std::vector<float> depths;

  [[nodiscard]] float lit(glm::vec3 place, float bias) const {
    const glm::vec3 p = raster.project(place);
    float open = 0;
    float count = 0;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int x = static_cast<int>(std::floor(p.x)) + dx;
        const int y = static_cast<int>(std::floor(p.y)) + dy;
        if (x < 0 || y < 0 || x >= static_cast<int>(raster.width) ||
            y >= static_cast<int>(raster.height)) {
          continue;
        }
        const std::size_t at =
            static_cast<std::size_t>(y) * raster.width + static_cast<std::size_t>(x);
        open += depths[at] <= p.z + bias ? 1.0F : 0.0F;
        ++count;
      }
    }
    return count > 0 ? open / count : 1;
  }
};

ShadowMap map_shadows(const fabric::Tile& tile, const Raster& eye, glm::vec3 to_light) {
  ShadowMap map;
  const float side_mm =
      2.2F * static_cast<float>(std::max(eye.width, eye.height)) / eye.pixels_per_mm;
  map.raster.rotation = look_along(to_light, 0);
  map.raster.width = map.raster.height = kShadowSide;
  map.raster.pixels_per_mm = static_cast<float>(kShadowSide) / side_mm;
  map.depths.assign(static_cast<std::size_t>(kShadowSide) * kShadowSide,
                    std::numeric_limits<float>::lowest());
  for_each_copy(tile, map.raster, [&](const Piece& piece) {
    rasterise(map.raster, piece,
              [&](std::uint32_t x, std::uint32_t y, float depth, float, glm::vec2) {
                float& at = map.depths[static_cast<std::size_t>(y) * kShadowSide + x];
                at = std::max(at, depth);
              });
  });
  return map;
}

std::uint8_t to_srgb(float linear) {
  const float c = std::clamp(linear, 0.0F, 1.0F);
  const float s = c <= 0.0031308F ? 12.92F * c : 1.055F * std::pow(c, 1 / 2.4F) - 0.055F;
  return static_cast<std::uint8_t>(std::lround(255 * s));
}

}  // namespace

std::vector<std::uint8_t> draw_tile(const fabric::Tile& tile, const std::vector<glm::vec3>& colours,
                                    const PictureView& view) {
  CHECK_EQ(colours.size(), tile.material_names.size());
  const auto tilt = static_cast<float>(view.tilt_rad);
  const auto turn = static_cast<float>(view.turn_rad);
  Raster eye;
  eye.width = view.width * kSamples;
  eye.height = view.height * kSamples;
  eye.pixels_per_mm = static_cast<float>(eye.width / view.width_mm);
  const glm::vec3 to_eye{std::sin(tilt) * std::sin(turn), -std::sin(tilt) * std::cos(turn),
                         std::cos(tilt)};
  eye.rotation = look_along(to_eye, turn);
  // From the viewer's upper left, so that what is seen is lit.
  const glm::vec3 to_light =
      glm::transpose(eye.rotation) * glm::normalize(glm::vec3(-0.55F, 0.6F, 1.0F));
  const std::vector<Hit> hits = find_hits(tile, eye);
  const ShadowMap shadows = map_shadows(tile, eye, to_light);

  const float middle = 0.5F * (tile.z_min_mm + tile.z_max_mm);
  const float half_height = 0.5F * (tile.z_max_mm - tile.z_min_mm);
  const glm::vec3 half_way = glm::normalize(to_light + to_eye);
  std::vector<glm::vec3> sums(static_cast<std::size_t>(view.width) * view.height, glm::vec3(0));
  for (std::size_t k = 0; k < hits.size(); ++k) {
    const Hit& hit = hits[k];
    glm::vec3 colour = kBackground;
    if (hit.depth > std::numeric_limits<float>::lowest()) {
      const fabric::Strand& strand = tile.strands[tile.segment_strand[hit.segment]];
      const float lit = shadows.lit(hit.place, kShadowBiasRadii * strand.radius_mm);
      const float diffuse = std::max(0.0F, glm::dot(hit.normal, to_light)) * lit;
      const float shine = std::pow(std::max(0.0F, glm::dot(hit.normal, half_way)), 24.0F) * lit;
      const float open =
          std::clamp(0.6F + 0.4F * (hit.place.z - middle) / half_height, 0.15F, 1.0F);
      colour = colours[strand.material] * (0.35F * open + 0.7F * diffuse) + 0.12F * shine;
    }
    const std::size_t x = (k % eye.width) / kSamples;
    const std::size_t y = (k / eye.width) / kSamples;
    sums[y * view.width + x] += colour;
  }
  std::vector<std::uint8_t> bytes;
  bytes.reserve(3 * sums.size());
  for (const glm::vec3& sum : sums) {
    for (int c = 0; c < 3; ++c) {
      bytes.push_back(to_srgb(sum[c] / static_cast<float>(kSamples * kSamples)));
    }
  }
  return bytes;
}

}  // namespace weft::cli
