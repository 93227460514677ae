#pragma once

#include <map>
#include <memory>
#include <string>

#include "proto/weft/v1/scene.pb.h"
#include "render/integrator.h"
#include "render/scene.h"

namespace weft::render {

// The integrator that a scene's `integration` (defaults expanded) asks for. Keeps a reference to
// `scene`, which must outlive it. With `wants_shadow` it fills EyeSample::shadow (baselines do
// not). REQUIRES: every fabric of `scene` has something precomputed, if reads_transfer.
[[nodiscard]] std::unique_ptr<Integrator> make_integrator(const v1::Integration& integration,
                                                          const Scene& scene,
                                                          bool wants_shadow = false);

// Which light the integration asks for.
[[nodiscard]] Scattering scattering_of(const v1::Integration& integration);

// Whether a Vulkan device can draw it (gpu/draw_on_device.h); what it cannot is the CPU's.
[[nodiscard]] bool draws_on_device(const v1::Integration& integration);

// Whether the integrator reads what was precomputed of a fabric, and not its fibres alone.
[[nodiscard]] bool reads_transfer(v1::Integrator integrator);

// The names by which people choose integrators (path, precomputed, dual, prt).
[[nodiscard]] const std::map<std::string, v1::Integrator>& integrators_by_name();

}  // namespace weft::render
