#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cli/picture_metadata.h"
#include "cli/render_options.h"
#include "cli/render_report.h"
#include "render/draw_pictures.h"

namespace weft::cli {

// Writes pictures to the files that the options name, and shows on stderr how far they are.
class PictureFiles : public render::PictureSink {
 public:
  // `fabrics` says what the fabrics of the frame that was started are. Checks that every file of
  // `scene` can be written: throws core::Error as check_output_file, and kInvalidArgument when an
  // animation's files have no place for the number of a frame.
  PictureFiles(const RenderOptions& options, const v1::Scene& scene,
               std::function<FabricIdentities()> fabrics);

  [[nodiscard]] bool start(const render::Frame& frame) override;
  void progress(double share_of_frame) override;
  void pass(const render::Frame& frame, const render::Picture& picture) override;
  void finish(const render::Frame& frame, const render::Picture& picture) override;

  [[nodiscard]] const std::vector<WrittenPicture>& written() const { return written_; }
  // What there is of the frame that was being drawn when it was broken off, as a sentence.
  [[nodiscard]] std::string what_is_kept() const;

 private:
  [[nodiscard]] std::map<std::string, std::string> recipe(const render::Frame& frame,
                                                          std::uint32_t samples) const;
  void write(const render::Frame& frame, const render::Picture& picture);
  [[nodiscard]] WrittenPicture written_picture(const render::Frame& frame) const;

  const RenderOptions& options_;
  std::function<FabricIdentities()> fabrics_;
  bool is_animation_;
  bool is_terminal_;
  std::vector<WrittenPicture> written_;
  std::uint32_t frame_ = 0;
  std::uint32_t frames_ = 1;
  std::uint32_t samples_wanted_ = 0;
  std::uint32_t samples_kept_ = 0;  // of the frame that is being drawn, on disk
  std::vector<std::string> remarks_;
};

}  // namespace weft::cli
