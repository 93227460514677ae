#include "render/environment_cache.h"

#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "core/digest.h"
#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"

namespace weft::render {
namespace {

// Raised when the fit gives other lights for the same picture and settings.
constexpr std::uint64_t kFitRevision = 1;
constexpr std::uint64_t kEntryLimitBytes = 1 << 20;

core::Digest key_of(const EnvironmentLight& light, const EnvironmentFitSettings& settings) {
  const Image& picture = light.environment->picture();
  core::Hasher hasher;
  hasher.field("weft.environment_fit");
  hasher.number(kFitRevision);
  hasher.number(settings.most_lights);
  hasher.number(settings.upper_half || light.cut_at_horizon ? 1 : 0);
  hasher.number(picture.width);
  hasher.number(picture.height);
  hasher.bytes({reinterpret_cast<const char*>(picture.pixels.data()),
                picture.pixels.size() * sizeof(picture.pixels[0])});
  return hasher.finish();
}

// An entry is text: the errors, then one light a line, then the digest of all that. Numbers are
// written so that reading them gives the same bits.
std::string text_of(const EnvironmentFit& fit) {
  std::string text = fmt::format("{} {}\n", fit.relative_error, fit.irradiance_error);
  for (const SgLight& light : fit.lights) {
    text += fmt::format("{} {} {} {} {} {} {} {}\n", light.towards.x, light.towards.y,
                        light.towards.z, light.sharpness, light.irradiance.x, light.irradiance.y,
                        light.irradiance.z, light.cut_at_horizon ? 1 : 0);
  }
  return text + core::digest_of(text).hex() + "\n";
}

std::optional<EnvironmentFit> fit_in(const std::string& text) {
  constexpr std::size_t kSealLength = 65;  // a digest and its newline
  if (text.size() <= kSealLength) {
    return std::nullopt;
  }
  const std::string body = text.substr(0, text.size() - kSealLength);
  if (text.substr(body.size()) != core::digest_of(body).hex() + "\n") {
    return std::nullopt;
  }
  std::istringstream words(body);
  EnvironmentFit fit;
  words >> fit.relative_error >> fit.irradiance_error;
  for (SgLight light; words >> light.towards.x >> light.towards.y >> light.towards.z >>
                      light.sharpness >> light.irradiance.x >> light.irradiance.y >>
                      light.irradiance.z >> light.cut_at_horizon;) {
    fit.lights.push_back(light);
  }
  return fit;
}

std::optional<EnvironmentFit> kept_at(const std::filesystem::path& path) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure)) {
    return std::nullopt;
  }
  try {
    return fit_in(core::read_file(path, kEntryLimitBytes));
  } catch (const core::Error&) {  // it went meanwhile, or is no entry of ours: made again
    return std::nullopt;
  }
}

}  // namespace

EnvironmentFit cached_environment_fit(const EnvironmentLight& light,
                                      const EnvironmentFitSettings& settings,
                                      const std::filesystem::path& folder) {
  if (folder.empty()) {
    return fit_environment(light, settings);
  }
  const std::filesystem::path path = folder / (key_of(light, settings).hex() + ".lights");
  EnvironmentFit unturned;
  if (std::optional<EnvironmentFit> kept = kept_at(path)) {
    unturned = *std::move(kept);
  } else {
    unturned = fit_unturned(light, settings);
    core::make_folder(folder, "set XDG_CACHE_HOME to one that can be written");
    core::write_file_atomically(path, text_of(unturned));
  }
  return turned(std::move(unturned), light.environment->turn());
}

void fit_environments(Scene& scene, const EnvironmentFitSettings& settings,
                      const std::filesystem::path& folder) {
  std::vector<Light> lights;
  for (const Light& light : scene.lights) {
    if (const auto* environment = std::get_if<EnvironmentLight>(&light)) {
      const EnvironmentFit fit = cached_environment_fit(*environment, settings, folder);
      lights.insert(lights.end(), fit.lights.begin(), fit.lights.end());
      scene.remarks.push_back(fmt::format(
          "an environment is drawn as {} spherical Gaussians: {:.1f} % off in radiance seen three "
          "degrees wide, {:.2f} % in irradiance",
          fit.lights.size(), 100 * fit.relative_error, 100 * fit.irradiance_error));
    } else if (const auto* uniform = std::get_if<UniformLight>(&light)) {
      lights.emplace_back(gaussian_of(*uniform));
    } else {
      lights.push_back(light);
    }
  }
  scene.lights = std::move(lights);
}

}  // namespace weft::render
