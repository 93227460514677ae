#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cli/render_options.h"
#include "render/draw_pictures.h"

namespace weft::cli {

// A picture that was written, for the report.
struct WrittenPicture {
  std::uint32_t frame = 0;
  std::string out;
  std::string png;  // empty: none was asked for
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t samples_per_pixel = 0;
  bool was_there = false;  // a finished frame of an earlier run: nothing below is known
  glm::dvec3 cloth_mean{0, 0, 0};
  glm::dvec3 cloth_standard_error{0, 0, 0};
  double cloth_share = 0;
  double mean_samples = 0;  // of a pixel
  double load_seconds = 0;
  double draw_seconds = 0;
  std::string device;  // that drew it
};

// Says on stdout what was drawn and how long it took: of one picture its figures, of an animation a
// line for each frame.
void report_pictures(const RenderOptions& options, const v1::Scene& scene,
                     const std::vector<WrittenPicture>& pictures);

}  // namespace weft::cli
