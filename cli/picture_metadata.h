#pragma once

#include <map>
#include <string>

#include "proto/weft/v1/scene.pb.h"
#include "render/draw.h"
#include "render/image.h"

namespace weft::cli {

// What a fabric was when it was drawn.
struct FabricIdentity {
  std::string name;            // of its description
  std::string content_digest;  // hexadecimal; empty for a description
};
using FabricIdentities = std::map<std::string, FabricIdentity>;  // by reference

// What the header of a picture says that was drawn from a still scene: everything that it takes to
// draw it again, and nothing about when or where.
[[nodiscard]] std::map<std::string, std::string> recipe_of(const v1::Scene& still,
                                                           const FabricIdentities& fabrics,
                                                           render::ExrPixels pixels);

// The figures of a drawing, for its header.
[[nodiscard]] std::map<std::string, std::string> figures_of(const render::Drawing& drawing);

// Whether the picture at `path` was drawn from this recipe, to its end. False when there is none,
// or none that can be read.
[[nodiscard]] bool is_drawn_from(const std::string& path,
                                 const std::map<std::string, std::string>& recipe);

// What a picture's header tells of how it was drawn.
struct RecordedPicture {
  v1::Scene scene;
  FabricIdentities fabrics;
  render::ExrPixels pixels = render::ExrPixels::kHalf;
  std::string device;  // that drew it: its name, or cpu; empty when the header does not say
};

// Throws core::Error: what read_exr throws, and kInvalidArgument when the header does not say how
// the picture was drawn.
[[nodiscard]] RecordedPicture read_recipe(const std::string& path);

}  // namespace weft::cli
