#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "core/digest.h"
#include "proto/weft/v1/cluster.pb.h"
#include "worker/baker.h"
#include "worker/input_cache.h"

namespace weft::worker {

// Bakers of the stages that this worker computed last, so that inputs are decoded and scenes built
// once per stage, not once per shard. Any thread; threads that want the same stage wait for the one
// that prepares it, others do not.
class StageBakers {
 public:
  using Maker = std::function<std::unique_ptr<Baker>(BakerContext)>;  // make_baker's type

  // Stages of one shard take up to `threads` of them.
  StageBakers(InputCache& inputs, Maker maker, unsigned threads)
      : inputs_(inputs), maker_(std::move(maker)), threads_(threads) {}

  struct Prepared {
    std::shared_ptr<const Baker> baker;  // shared: the cache may drop it while shards still run
    double prepare_seconds = 0;          // 0 when it was there already
  };
  // Throws what reading the inputs and make_baker throw; the next call tries again.
  [[nodiscard]] Prepared of(const v1::Assignment& assignment,
                            const std::function<bool()>& should_stop);

  // The first inputs (tiles, where a stage has a scene) of the stages that are held.
  [[nodiscard]] std::vector<core::Digest> scenes();

 private:
  struct Slot {
    core::Digest stage;
    std::optional<core::Digest> scene;
    std::atomic<bool> is_ready{false};
    std::mutex mutex;
    std::shared_ptr<const Baker> baker;
  };

  [[nodiscard]] std::shared_ptr<Slot> slot_of(const v1::Assignment& assignment);

  InputCache& inputs_;
  const Maker maker_;
  const unsigned threads_;
  std::mutex mutex_;
  std::list<std::shared_ptr<Slot>> slots_;  // the one used last first
};

}  // namespace weft::worker
