#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/weft/v1/scene.pb.h"

namespace weft::render {

// What a picture may hold besides its colour. Those of the surface (segment, tangent, normal) are
// of the pixel's first sample: their means would mean nothing.
enum class Layer : std::uint32_t {
  kSingle,    // radiance of light that met one fibre
  kMultiple,  // ... more than one
  kShadow,    // share of the lights that cloth as a whole lets through to above the hit
  kSegment,   // which segment of which piece of cloth is seen
  kTangent,   // of the fibre, unit, in the world
  kNormal,    // of the cloth, unit, in the world: to the upper side of the flat fabric
  kVariance,  // of the pixel's mean, that is its standard error squared
};
inline constexpr std::uint32_t kLayerCount = 7;

// Some of the layers.
class LayerSet {
 public:
  [[nodiscard]] static LayerSet all();
  void add(Layer layer) { bits_ |= bit(layer); }
  [[nodiscard]] bool has(Layer layer) const { return (bits_ & bit(layer)) != 0; }
  [[nodiscard]] bool empty() const { return bits_ == 0; }
  bool operator==(const LayerSet&) const = default;

 private:
  [[nodiscard]] static std::uint32_t bit(Layer layer) {
    return 1U << static_cast<std::uint32_t>(layer);
  }
  std::uint32_t bits_ = 0;
};

// Reads "single,shadow" or "all"; "" is none. Throws core::Error(kInvalidArgument) naming the
// layers there are.
[[nodiscard]] LayerSet parse_layers(std::string_view text);

// The names in the order of Layer, with commas: what parse_layers reads.
[[nodiscard]] std::string layers_text(LayerSet layers);

// Between a scene's picture and a set of layers.
[[nodiscard]] LayerSet layers_of(const v1::Picture& picture);
void set_layers(LayerSet layers, v1::Picture& picture);

// No segment is seen.
inline constexpr std::uint32_t kNoSegment = 0xffffffff;

// The layers of a picture: each [height, width], or empty when it was not wanted. The variance is
// not here: Drawing::standard_error tells it.
struct Layers {
  std::vector<glm::vec3> single;
  std::vector<glm::vec3> multiple;     // cut at 0, as the picture is
  std::vector<float> shadow;           // mean over the samples that met cloth; 0 where none did
  std::vector<std::uint32_t> segment;  // kNoSegment where no fibre is seen
  std::vector<std::uint32_t> cloth;    // index of the piece of cloth; kNoSegment where none is seen
  std::vector<glm::vec3> tangent;      // zero where no fibre is seen
  std::vector<glm::vec3> normal;
};

}  // namespace weft::render
