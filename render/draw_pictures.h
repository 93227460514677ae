#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "proto/weft/v1/scene.pb.h"
#include "render/build_scene.h"
#include "render/draw.h"
#include "render/gpu/device_renderer.h"

namespace weft::render {

// How the pictures of a scene are drawn, where that is no matter of the scene.
struct PictureSettings {
  unsigned threads = 0;                     // 0: as many as the machine has
  bool progressive = false;                 // in passes of 1, 1, 2, 4, 8, ... samples a pixel
  std::filesystem::path environment_cache;  // fits of environments are kept here; empty: nowhere
  // Draws what it can (draws_on_device); null: the CPU draws everything.
  gpu::DeviceRenderer* device = nullptr;
};

// One picture of a scene: its only one, or a frame of its animation.
struct Frame {
  std::uint32_t number = 0;
  std::uint32_t index = 0;  // from 0, of `count`
  std::uint32_t count = 1;
  v1::Scene scene;                   // without an animation: enough to draw this picture again
  std::vector<std::string> remarks;  // what a person should know about it
};

// A picture that is drawn.
struct Picture {
  Drawing drawing;
  std::uint32_t samples_per_pixel = 0;  // fewer than the scene's while it is being refined
  double load_seconds = 0;
  double draw_seconds = 0;
  std::string device = "cpu";  // that drew it
};

// Receives pictures as they come. Calls are made one at a time, in the order: for each frame
// start, then progress and pass any number of times, then finish. What they throw ends the drawing.
class PictureSink {
 public:
  PictureSink() = default;
  PictureSink(const PictureSink&) = delete;
  PictureSink& operator=(const PictureSink&) = delete;
  PictureSink(PictureSink&&) = delete;
  PictureSink& operator=(PictureSink&&) = delete;
  virtual ~PictureSink() = default;

  // Returns whether the frame is wanted; a frame that is not is skipped.
  [[nodiscard]] virtual bool start(const Frame& frame) = 0;
  virtual void progress(double share_of_frame) = 0;
  // The frame so far, after each pass but the last; of progressive drawing only.
  virtual void pass(const Frame& frame, const Picture& picture) = 0;
  virtual void finish(const Frame& frame, const Picture& picture) = 0;
};

// Draws every picture that a complete, checked scene (scene_description.h) describes. Each has the
// same seed: what neither moves nor is lit otherwise is the same, bit by bit, in all frames. Throws
// core::Error: what build_scene throws, kInvalidArgument for a frame that cannot be drawn, before
// any is, and kCancelled when `should_stop` says so.
void draw_pictures(const v1::Scene& scene, const PictureSettings& settings,
                   const FabricSource& fabrics, const FileSource& files, PictureSink& sink,
                   const std::function<bool()>& should_stop);

// The DrawSettings that a scene's picture and integration ask for.
[[nodiscard]] DrawSettings draw_settings(const v1::Scene& scene, unsigned threads);

}  // namespace weft::render
