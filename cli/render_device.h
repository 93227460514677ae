#pragma once

#include <memory>
#include <string>

#include "proto/weft/v1/scene.pb.h"
#include "render/gpu/device_renderer.h"

namespace weft::cli {

// The device that `--device` names and that draws the scene: "auto" for a GPU where there is one,
// or an index or a part of a name; null when the CPU draws it, because "cpu" says so, no GPU is
// there, or no device can. Throws core::Error: kInvalidArgument when a device is named for what
// only the CPU draws, kNotFound naming the devices there are, kFailedPrecondition without a driver.
[[nodiscard]] std::unique_ptr<render::gpu::DeviceRenderer> open_render_device(
    const std::string& wanted, const v1::Scene& scene);

}  // namespace weft::cli
