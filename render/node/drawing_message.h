#pragma once

#include <functional>
#include <string>
#include <vector>

#include "proto/weft/v1/render.pb.h"
#include "render/draw_pictures.h"

namespace weft::render {

// A picture as it travels (render.proto, PictureHeader): the header, and the planes it lists.
[[nodiscard]] v1::PictureHeader header_of(const Picture& picture, bool finished);

// Calls `send` with the bytes of the header's planes, in pieces of a chunk's limit, in order; ends
// early, with false, when `send` returns false.
[[nodiscard]] bool send_planes(const Drawing& drawing, const v1::PictureHeader& header,
                               const std::function<bool(std::string)>& send);

// Puts a picture together that arrives in chunks.
class PictureReceiver {
 public:
  // REQUIRES: width, height and layers are those of the scene that was ordered. Throws
  // core::Error(kDataLoss) when the header contradicts them.
  PictureReceiver(const v1::PictureHeader& header, const DrawSettings& wanted);

  // Throws core::Error(kDataLoss) when more comes than the header said.
  void add(const std::string& chunk);
  [[nodiscard]] bool complete() const { return received_bytes_ == bytes_.size(); }
  // REQUIRES: complete().
  [[nodiscard]] Picture picture() const;

 private:
  v1::PictureHeader header_;
  std::string bytes_;
  std::size_t received_bytes_ = 0;
};

}  // namespace weft::render
