#include "cli/render_device.h"

#include "core/error.h"
#include "render/make_integrator.h"

namespace weft::cli {

std::unique_ptr<render::gpu::DeviceRenderer> open_render_device(const std::string& wanted,
                                                                const v1::Scene& scene) {
  if (!render::draws_on_device(scene.integration())) {
    if (wanted != "auto" && wanted != "cpu") {
      throw core::Error(
          core::Code::kInvalidArgument,
          "--device " + wanted +
              ": devices draw the precomputed integrator alone, from its database and with "
              "as many samples for each pixel; "
              "leave --device away, or write --device cpu");
    }
    return nullptr;
  }
  try {
    return render::gpu::open_renderer(wanted);
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kFailedPrecondition) {
      throw;
    }
    throw core::Error(error.code(), std::string(error.what()) + "; or draw with --device cpu");
  }
}

}  // namespace weft::cli
