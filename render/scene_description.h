#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "proto/weft/v1/scene.pb.h"

namespace weft::render {

// Reads a scene, protobuf text or JSON (a name that ends in .json), and checks everything that can
// be checked without the fabrics and files it names. Paths in it are made relative to the folder it
// is read from. Throws core::Error: kNotFound when there is no such file, kInvalidArgument with
// every mistake, one per line, at its place (proto/document.h).
[[nodiscard]] v1::Scene load_scene(const std::filesystem::path& path);

// The same from memory; `name` stands for the file in messages, `folder` is where the files that it
// names are looked for.
[[nodiscard]] v1::Scene parse_scene(std::string_view text, const std::string& name,
                                    const std::filesystem::path& folder);

// The scene that is drawn when none is given: one endless flat swatch seen from aslant, an SG key
// light from the upper left and a softer one opposite, black underneath.
[[nodiscard]] v1::Scene default_scene();

// Writes out what the scene leaves to defaults: lights, cloth, the fabric of each piece of cloth
// (`fabric` where none is named), picture and integration. The camera stays as it is.
void complete_scene(v1::Scene& scene, const std::string& fabric);

// Sets every field of `picture` and `integration` that is not set to its default.
void expand_picture_defaults(v1::Scene& scene);

}  // namespace weft::render
