#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "proto/weft/v1/scene.pb.h"

namespace weft::coordinator {

// How a swatch is looked at on the page: an endless flat piece of the cloth under one light.
// Azimuths are counterclockwise from the weft's direction (+x), elevations above the cloth.
struct SwatchView {
  double light_azimuth_deg = 147;
  double light_elevation_deg = 49;
  double camera_azimuth_deg = -90;
  double camera_elevation_deg = 62;
  double sharpness = 60;  // of the light, a spherical Gaussian; 0: parallel light
  v1::Scattering scattering = v1::SCATTERING_ALL;
  double height_mm = 4;        // of the picture, in the plane of the cloth seen from straight above
  bool fill = true;            // a faint soft light besides, from the other side
  std::uint32_t size = 240;    // pixels a side
  std::uint32_t samples = 4;   // a pixel
  std::optional<float> stops;  // exposure; nothing: chosen by the picture
};

// The view that a query asks for: light_azimuth, light_elevation, camera_azimuth, camera_elevation,
// sharpness (a number or "parallel"), scattering (all, single, multiple), height, fill (0, 1),
// size, samples, stops (a number or "auto"); what is left out is as above. Throws
// core::Error(kInvalidArgument) that names the field and what it may be.
[[nodiscard]] SwatchView swatch_view_from(const std::map<std::string, std::string>& query);

// `reference` is NAME@NUMBER.
[[nodiscard]] v1::Scene scene_of(const SwatchView& view, const std::string& reference);

// The view of thumbnails, and what is to change when they look otherwise: kept ones are named by
// it.
inline constexpr const char* kThumbnailEdition = "1";

}  // namespace weft::coordinator
