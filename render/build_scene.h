#pragma once

#include <functional>
#include <memory>
#include <string>

#include "proto/weft/v1/scene.pb.h"
#include "render/fabric.h"
#include "render/file_source.h"
#include "render/scene.h"

namespace weft::render {

// Gives the fabric that a scene's `fabric` names; empty: the one on the command line. Throws
// core::Error when there is none. Equal names give the same object.
using FabricSource = std::function<std::shared_ptr<const Fabric>(const std::string& reference)>;

// The scene that a checked description (scene_description.h, picture defaults expanded) describes:
// reads its meshes and pictures from `files`, places the cloth, and frames it where the description
// has no camera. Scenes without lights or cloth get those of default_scene. Throws core::Error.
[[nodiscard]] Scene build_scene(const v1::Scene& description, const FabricSource& fabrics,
                                const FileSource& files = files_on_disk());

}  // namespace weft::render
