#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "proto/weft/v1/render.pb.h"
#include "render/draw_pictures.h"

namespace weft::render {

// What a drawing order has to say, between the thread that draws and the one that writes: drawing
// does not wait for a slow caller until two finished frames are held up. Of one drawing and one
// writing thread.
class Outbox {
 public:
  // Small events, in order. A progress that was not taken is overwritten by the next.
  void put(v1::RenderResponse event);
  // A pass; it replaces one that was not taken.
  void put_pass(const Picture& picture);
  // A finished picture. Waits for room; false when nobody takes anything any more.
  [[nodiscard]] bool put_finished(const Picture& picture);
  // Nothing more will be put.
  void close();

  // Something to write: an event, or a picture.
  struct Item {
    v1::RenderResponse event;
    std::shared_ptr<const Picture> picture;  // null: the event alone. Shared: items are copied
    bool finished = false;
  };
  // Waits; nothing when the box is closed and empty.
  [[nodiscard]] std::optional<Item> take();
  // The writer gives up: what is in the box is thrown away.
  void abandon();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Item> items_;
  bool closed_ = false;
  bool abandoned_ = false;
};

}  // namespace weft::render
