#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/digest.h"
#include "proto/weft/v1/task.pb.h"

namespace weft::worker {

// One stage's work as a baker sees it. `inputs` are the stage's common inputs.
struct BakerContext {
  v1::TaskSpec spec;
  std::uint64_t shard_count = 0;
  std::vector<std::string> inputs;  // bytes, in the order the spec's comment names them
  unsigned most_threads = 1;        // that a stage of one shard may take, while others wait for it
};

// Computes shards of one stage. Made once per stage (it decodes the inputs and builds the Embree
// scene), then bake() is called from any number of threads at once. The result is the serialised
// envelope and depends on nothing but (spec, inputs, shard, shard_input).
class Baker {
 public:
  Baker() = default;
  Baker(const Baker&) = delete;
  Baker& operator=(const Baker&) = delete;
  Baker(Baker&&) = delete;
  Baker& operator=(Baker&&) = delete;
  virtual ~Baker() = default;

  // `shard_input`: the result of the same shard of the stage this one is aligned with (for
  // coefficients: visibility), else empty. Calls `should_stop` now and then and throws
  // core::Error(kCancelled) when it says so. Throws core::Error on bad inputs.
  [[nodiscard]] virtual std::string bake(std::uint64_t shard, const std::string& shard_input,
                                         const std::function<bool()>& should_stop) const = 0;
};

// The baker of spec's kind. Throws core::Error(kInvalidArgument) on an unknown kind.
[[nodiscard]] std::unique_ptr<Baker> make_baker(BakerContext context);

// A digest of what this machine's arithmetic gives on a small fixed probe (libm, Embree): machines
// with equal fingerprints give equal bytes. It enters every shard's digest.
[[nodiscard]] core::Digest numerics_fingerprint();

}  // namespace weft::worker
