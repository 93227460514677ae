#include "worker/tile_scene.h"

#include <algorithm>
#include <list>
#include <mutex>

#include "core/digest.h"

namespace weft::worker {

namespace {

// A scene that somebody holds, or that is being built.
struct Slot {
  explicit Slot(core::Digest digest_in) : digest(digest_in) {}
  core::Digest digest;
  std::mutex mutex;
  std::weak_ptr<const TileScene> scene;
};

std::shared_ptr<Slot> slot_of(const core::Digest& digest) {
  static std::mutex mutex;
  static std::list<std::shared_ptr<Slot>> slots;
  const std::lock_guard lock(mutex);
  slots.remove_if([](const auto& slot) { return slot.use_count() == 1 && slot->scene.expired(); });
  const auto found = std::find_if(slots.begin(), slots.end(),
                                  [&](const auto& slot) { return slot->digest == digest; });
  return found != slots.end() ? *found : slots.emplace_back(std::make_shared<Slot>(digest));
}

}  // namespace

TileScene::TileScene(std::string_view bytes) : tile(fabric::decode_tile(bytes)), scene(tile) {}

std::shared_ptr<const TileScene> tile_scene(std::string_view bytes) {
  const std::shared_ptr<Slot> slot = slot_of(core::digest_of(bytes));
  const std::lock_guard lock(slot->mutex);
  std::shared_ptr<const TileScene> scene = slot->scene.lock();
  if (!scene) {
    scene = std::make_shared<const TileScene>(bytes);
    slot->scene = scene;
  }
  return scene;
}

}  // namespace weft::worker
