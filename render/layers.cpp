#include "render/layers.h"

#include <array>

#include "core/error.h"

namespace weft::render {
namespace {

static_assert(static_cast<std::uint32_t>(Layer::kVariance) + 1 == v1::PICTURE_LAYER_VARIANCE);

constexpr std::array<const char*, kLayerCount> kNames = {
    "single", "multiple", "shadow", "segment", "tangent", "normal", "variance"};

void add_named(std::string_view name, LayerSet& layers) {
  for (std::uint32_t i = 0; i < kLayerCount; ++i) {
    if (name == kNames[i]) {
      layers.add(static_cast<Layer>(i));
      return;
    }
  }
  throw core::Error(core::Code::kInvalidArgument,
                    "'" + std::string(name) + "' is no layer; there are " +
                        layers_text(LayerSet::all()) + ", separated by commas, and all");
}

}  // namespace

LayerSet LayerSet::all() {
  LayerSet layers;
  for (std::uint32_t i = 0; i < kLayerCount; ++i) {
    layers.add(static_cast<Layer>(i));
  }
  return layers;
}

LayerSet parse_layers(std::string_view text) {
  if (text == "all") {
    return LayerSet::all();
  }
  LayerSet layers;
  while (!text.empty()) {
    const std::size_t comma = text.find(',');
    add_named(text.substr(0, comma), layers);
    text = comma == std::string_view::npos ? std::string_view() : text.substr(comma + 1);
  }
  return layers;
}

std::string layers_text(LayerSet layers) {
  std::string text;
  for (std::uint32_t i = 0; i < kLayerCount; ++i) {
    if (layers.has(static_cast<Layer>(i))) {
      text += text.empty() ? "" : ",";
      text += kNames[i];
    }
  }
  return text;
}

// The schema's numbers are one above those of Layer.
LayerSet layers_of(const v1::Picture& picture) {
  LayerSet layers;
  for (const int number : picture.layers()) {
    if (number > 0 && number <= static_cast<int>(kLayerCount)) {
      layers.add(static_cast<Layer>(number - 1));
    }
  }
  return layers;
}

void set_layers(LayerSet layers, v1::Picture& picture) {
  picture.clear_layers();
  for (std::uint32_t i = 0; i < kLayerCount; ++i) {
    if (layers.has(static_cast<Layer>(i))) {
      picture.add_layers(static_cast<v1::PictureLayer>(i + 1));
    }
  }
}

}  // namespace weft::render
