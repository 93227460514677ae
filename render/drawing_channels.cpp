#include "render/drawing_channels.h"

#include <string>
#include <utility>
#include <vector>

namespace weft::render {
namespace {

void attach_triple(Image& image, const std::vector<glm::vec3>& values, const std::string& layer,
                   const char* axes, bool always_float) {
  for (int c = 0; c < 3 && !values.empty(); ++c) {
    std::vector<float> plane;
    plane.reserve(values.size());
    for (const glm::vec3& value : values) {
      plane.push_back(value[c]);
    }
    image.channels.push_back({layer + "." + axes[c], std::move(plane), always_float});
  }
}

}  // namespace

void attach_layers(Drawing& drawing, LayerSet wanted) {
  Image& image = drawing.image;
  const Layers& layers = drawing.layers;
  if (wanted.has(Layer::kSingle)) {
    attach_triple(image, layers.single, "single", "RGB", false);
  }
  if (wanted.has(Layer::kMultiple)) {
    attach_triple(image, layers.multiple, "multiple", "RGB", false);
  }
  if (wanted.has(Layer::kShadow) && !layers.shadow.empty()) {
    image.channels.push_back({"shadow.Y", layers.shadow});
  }
  if (wanted.has(Layer::kSegment) && !layers.segment.empty()) {
    image.channels.push_back({"segment.id", layers.segment});
    image.channels.push_back({"segment.cloth", layers.cloth});
  }
  if (wanted.has(Layer::kTangent)) {
    attach_triple(image, layers.tangent, "tangent", "XYZ", false);
  }
  if (wanted.has(Layer::kNormal)) {
    attach_triple(image, layers.normal, "normal", "XYZ", false);
  }
  if (wanted.has(Layer::kVariance)) {
    std::vector<glm::vec3> variance;
    variance.reserve(drawing.standard_error.pixels.size());
    for (const glm::vec3& error : drawing.standard_error.pixels) {
      variance.push_back(error * error);
    }
    attach_triple(image, variance, "variance", "RGB", true);
  }
}

}  // namespace weft::render
