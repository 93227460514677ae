#pragma once

#include "core/mistakes.h"
#include "proto/weft/v1/scene.pb.h"

namespace weft::render {

// What is wrong with a scene, as far as that can be told without the fabrics and files it names;
// nothing when it can be drawn. The messages do not name the fields; the paths do.
[[nodiscard]] core::Mistakes check_scene(const v1::Scene& scene);

}  // namespace weft::render
