#include "cli/picture_files.h"

#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include "cli/output_file.h"
#include "core/error.h"
#include "render/animation.h"
#include "render/drawing_channels.h"
#include "render/png.h"

namespace weft::cli {

namespace {

render::ExrPixels pixels_of(const RenderOptions& options) {
  return options.floats ? render::ExrPixels::kFloat : render::ExrPixels::kHalf;
}

}  // namespace

PictureFiles::PictureFiles(const RenderOptions& options, const v1::Scene& scene,
                           std::function<FabricIdentities()> fabrics)
    : options_(options),
      fabrics_(std::move(fabrics)),
      is_animation_(scene.has_animation()),
      is_terminal_(isatty(fileno(stderr)) == 1),
      samples_wanted_(scene.picture().samples_per_pixel()) {
  for (const std::string& file : {options.out, options.png, options.stderr_image}) {
    if (file.empty()) {
      continue;
    }
    if (is_animation_ && !render::names_frames(file)) {
      throw core::Error(core::Code::kInvalidArgument,
                        file +
                            ": the scene is an animation, and the file has no place for the "
                            "number of a frame; write one, such as frame_%04d.exr");
    }
    check_output_file(file);
  }
}

std::map<std::string, std::string> PictureFiles::recipe(const render::Frame& frame,
                                                        std::uint32_t samples) const {
  v1::Scene still = frame.scene;
  still.mutable_picture()->set_samples_per_pixel(samples);
  return recipe_of(still, fabrics_(), pixels_of(options_));
}

WrittenPicture PictureFiles::written_picture(const render::Frame& frame) const {
  const auto named = [&](const std::string& file) {
    return is_animation_ ? render::with_frame_number(file, frame.number) : file;
  };
  WrittenPicture written;
  written.frame = frame.number;
  written.out = named(options_.out);
  written.png = named(options_.png);
  written.width = frame.scene.picture().width();
  written.height = frame.scene.picture().height();
  written.samples_per_pixel = frame.scene.picture().samples_per_pixel();
  return written;
}

bool PictureFiles::start(const render::Frame& frame) {
  frame_ = frame.index;
  frames_ = frame.count;
  samples_kept_ = 0;
  if (remarks_ != frame.remarks) {  // the frames of an animation mostly have the same
    remarks_ = frame.remarks;
    for (const std::string& remark : remarks_) {
      fmt::print(stderr, "weft: {}\n", remark);
    }
  }
  WrittenPicture written = written_picture(frame);
  std::error_code failure;
  const bool is_shown = written.png.empty() || std::filesystem::exists(written.png, failure);
  if (options_.resume && is_shown &&
      is_drawn_from(written.out, recipe(frame, frame.scene.picture().samples_per_pixel()))) {
    written.was_there = true;
    written_.push_back(written);
    return false;
  }
  return true;
}

void PictureFiles::progress(double share_of_frame) {
  if (!is_terminal_) {
    return;
  }
  const std::string frame =
      frames_ > 1 ? fmt::format("frame {} of {}, ", frame_ + 1, frames_) : std::string();
  const std::string kept =
      samples_kept_ > 0 ? fmt::format(", {} of {} samples on disk", samples_kept_, samples_wanted_)
                        : std::string();
  const bool is_last = share_of_frame >= 1 && frame_ + 1 == frames_;
  fmt::print(stderr, "\r\x1b[K{}{:3.0f} % drawn{}{}", frame, 100 * share_of_frame, kept,
             is_last ? "\n" : "");
}

void PictureFiles::write(const render::Frame& frame, const render::Picture& picture) {
  const WrittenPicture names = written_picture(frame);
  std::map<std::string, std::string> attributes = recipe(frame, picture.samples_per_pixel);
  attributes.merge(figures_of(picture.drawing));
  attributes["weft.device"] = picture.device;
  render::Drawing drawing = picture.drawing;
  drawing.image.attributes = attributes;
  render::attach_layers(drawing, render::layers_of(frame.scene.picture()));
  render::write_exr(names.out, drawing.image, pixels_of(options_));
  if (!options_.stderr_image.empty()) {
    drawing.standard_error.attributes = attributes;
    drawing.standard_error.attributes["weft.content"] = "standard error of each pixel";
    render::write_exr(is_animation_ ? render::with_frame_number(options_.stderr_image, frame.number)
                                    : options_.stderr_image,
                      drawing.standard_error, pixels_of(options_));
  }
  if (!names.png.empty()) {
    const float exposure =
        options_.exposure ? *options_.exposure : render::automatic_exposure(drawing.image);
    render::write_png(names.png, drawing.image.width, drawing.image.height,
                      render::tone_mapped(drawing.image, exposure));
  }
}

void PictureFiles::pass(const render::Frame& frame, const render::Picture& picture) {
  write(frame, picture);
  samples_kept_ = picture.samples_per_pixel;
}

void PictureFiles::finish(const render::Frame& frame, const render::Picture& picture) {
  write(frame, picture);
  samples_kept_ = 0;
  WrittenPicture written = written_picture(frame);
  written.samples_per_pixel = picture.samples_per_pixel;
  written.cloth_mean = picture.drawing.cloth_mean;
  written.cloth_standard_error = picture.drawing.cloth_standard_error;
  written.cloth_share = picture.drawing.cloth_share;
  written.mean_samples = picture.drawing.mean_samples;
  written.load_seconds = picture.load_seconds;
  written.draw_seconds = picture.draw_seconds;
  written.device = picture.device;
  written_.push_back(written);
}

std::string PictureFiles::what_is_kept() const {
  if (is_terminal_) {
    fmt::print(stderr, "\n");
  }
  if (samples_kept_ > 0) {
    return fmt::format(
        "the last whole pass, {} of {} samples a pixel, is on disk; run the same command again for "
        "all of them",
        samples_kept_, samples_wanted_);
  }
  if (is_animation_) {
    return fmt::format("{} of {} frames are on disk; --resume goes on with the others",
                       written_.size(), frames_);
  }
  return "nothing was written; run the same command again to draw it";
}

}  // namespace weft::cli
