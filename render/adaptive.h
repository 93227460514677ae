#pragma once

#include <cstdint>
#include <vector>

#include "render/pixel_sums.h"

namespace weft::render {

// Samples that every pixel gets before it is decided how many more.
inline constexpr std::uint32_t kPilotSamples = 16;

struct AdaptiveSampling {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t most_samples = 0;
  double target_error = 0;  // above 0
};

// How many samples each pixel gets in all, [height, width], from kPilotSamples to most_samples:
// so many that its standard error is target_error times the geometric mean of its own brightness
// and the picture's. `pilot` are the sums of kPilotSamples samples of every pixel. A pixel's
// variance and brightness are taken from the 24 pixels around it and not from itself, so that a
// number does not depend on the samples that it adds to, and the mean of these is not biased.
// REQUIRES: most_samples >= kPilotSamples.
[[nodiscard]] std::vector<std::uint32_t> samples_by_pixel(const std::vector<PixelSums>& pilot,
                                                          const AdaptiveSampling& settings);

}  // namespace weft::render
