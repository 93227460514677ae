#pragma once

#include <filesystem>

#include "render/environment_fit.h"
#include "render/scene.h"

namespace weft::render {

// fit_environment, kept in `folder` under a digest of the picture and the settings, and read from
// there the next time; a damaged entry is made again. An empty path keeps nothing. Turning the
// picture makes no new entry. Throws core::Error(kUnavailable) when the folder cannot be written.
[[nodiscard]] EnvironmentFit cached_environment_fit(const EnvironmentLight& light,
                                                    const EnvironmentFitSettings& settings,
                                                    const std::filesystem::path& folder);

// Puts spherical Gaussians in the place of a scene's lights from everywhere, whether pictures or
// uniform, and says in the scene's remarks how well they fit. Throws as cached_environment_fit.
void fit_environments(Scene& scene, const EnvironmentFitSettings& settings,
                      const std::filesystem::path& folder);

}  // namespace weft::render
