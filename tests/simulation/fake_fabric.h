#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "coordinator/plan.h"
#include "core/digest.h"

// A precomputation of the same shape as the real one whose bakers cost nothing: the same stages,
// the same dependencies, counts that come out of earlier results.

namespace weft::simulation {

// What a job's description would say.
struct FakeFabric {
  std::string name;
  std::string cloth;   // what all stages read
  std::string colour;  // what the transfer stage reads beside it
  std::uint64_t visibility_shards = 1;
  std::uint64_t transfer_shards = 1;
  std::uint64_t shadow_shards = 1;
  std::uint64_t transfer_bytes = 0;  // of memory, that a worker needs for a transfer run
};

struct FakeStage {
  coordinator::StageName name{};
  std::string spec;
  std::uint64_t shard_count = 0;
  std::vector<core::Digest> inputs;
  std::vector<core::Digest> shard_inputs;
};

using ReadBlob = std::function<std::string(const core::Digest&)>;

// As coordinator::plan.
[[nodiscard]] std::vector<FakeStage> plan(const FakeFabric& fabric,
                                          const std::vector<coordinator::StageResults>& finished,
                                          const ReadBlob& read_blob);

// Names the work of one shard, from what an assignment says.
[[nodiscard]] core::Digest work_of(const std::string& spec, std::span<const core::Digest> inputs,
                                   const std::optional<core::Digest>& shard_input,
                                   std::uint64_t shard, const core::Digest& fingerprint);
[[nodiscard]] core::Digest work_of(const FakeStage& stage, std::uint64_t shard,
                                   const core::Digest& fingerprint);

// The bytes that an honest baker makes of it.
[[nodiscard]] std::string bake(const core::Digest& work);

// The digest of the database: of all results' bytes, in index order.
[[nodiscard]] core::Digest fold(const FakeFabric& fabric,
                                const std::vector<coordinator::StageResults>& finished,
                                const ReadBlob& read_blob);

// The same without any cluster, one shard after another.
[[nodiscard]] core::Digest undisturbed(const FakeFabric& fabric, const core::Digest& fingerprint);

}  // namespace weft::simulation
