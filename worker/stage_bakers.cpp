#include "worker/stage_bakers.h"

#include <algorithm>
#include <utility>

#include "core/clock.h"
#include "core/error.h"
#include "proto/arrays.h"

namespace weft::worker {

namespace {

// Visibility and transfer of one fabric run side by side, with a stage of one shard now and then; a
// scene of the largest tile is some GiB, so few are kept.
constexpr std::size_t kSlots = 3;

core::Digest stage_of(const v1::Assignment& assignment) {
  core::Hasher hasher;
  hasher.field(v1::canonical_bytes(assignment.spec()));
  hasher.number(assignment.shard_count());
  for (const std::string& input : assignment.inputs()) {
    hasher.field(input);
  }
  return hasher.finish();
}

}  // namespace

std::shared_ptr<StageBakers::Slot> StageBakers::slot_of(const v1::Assignment& assignment) {
  const core::Digest stage = stage_of(assignment);
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(slots_.begin(), slots_.end(),
                                  [&](const auto& slot) { return slot->stage == stage; });
  if (found != slots_.end()) {
    slots_.splice(slots_.begin(), slots_, found);
    return slots_.front();
  }
  auto slot = std::make_shared<Slot>();
  slot->stage = stage;
  if (!assignment.inputs().empty()) {
    slot->scene = core::Digest::from_binary(assignment.inputs(0));
  }
  slots_.push_front(slot);
  if (slots_.size() > kSlots) {
    slots_.pop_back();
  }
  return slot;
}

StageBakers::Prepared StageBakers::of(const v1::Assignment& assignment,
                                      const std::function<bool()>& should_stop) {
  const std::shared_ptr<Slot> slot = slot_of(assignment);
  const std::lock_guard lock(slot->mutex);
  if (slot->baker) {
    return {slot->baker, 0};
  }
  const core::Stopwatch since_start;
  BakerContext context{assignment.spec(), assignment.shard_count(), {}, threads_};
  for (const std::string& input : assignment.inputs()) {
    if (should_stop()) {
      throw core::Error(core::Code::kCancelled, "stopped while preparing a stage");
    }
    const auto digest = core::Digest::from_binary(input);
    if (!digest) {
      throw core::Error(core::Code::kInvalidArgument, "an input is not named by a digest");
    }
    context.inputs.push_back(inputs_.read(*digest, should_stop));
  }
  slot->baker = maker_(std::move(context));
  slot->is_ready.store(true);
  return {slot->baker, since_start.seconds()};
}

std::vector<core::Digest> StageBakers::scenes() {
  std::vector<core::Digest> scenes;
  const std::lock_guard lock(mutex_);
  for (const auto& slot : slots_) {
    const bool is_new = slot->scene && slot->is_ready.load() &&
                        std::find(scenes.begin(), scenes.end(), *slot->scene) == scenes.end();
    if (is_new) {
      scenes.push_back(*slot->scene);
    }
  }
  return scenes;
}

}  // namespace weft::worker
