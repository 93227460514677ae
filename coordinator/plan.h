#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/digest.h"
#include "proto/weft/v1/fabric.pb.h"
#include "proto/weft/v1/task.pb.h"

namespace weft::coordinator {

enum class StageName { kGeometry, kGrid, kVisibility, kBasis, kCoefficients, kTransfer, kShadow };
[[nodiscard]] const char* to_string(StageName name);

// A coordinator keeps some hundred bytes for each shard.
inline constexpr std::uint64_t kStageShardsLimit = 4'000'000;

// One stage of a job, ready to run: everything its shards read is known.
struct Stage {
  StageName name = StageName::kGeometry;
  v1::TaskSpec spec;
  std::uint64_t shard_count = 0;
  std::vector<core::Digest> inputs;        // result blobs that every shard reads
  std::vector<core::Digest> shard_inputs;  // empty, or one result blob per shard
  // What a worker is expected to need for a run, coarsely: 64 MiB, and what the stage's tables and
  // the Embree scene of its tile take. 0: not known.
  std::uint64_t memory_bytes = 0;
};

// Names the work of one shard; equal digests mean equal results. Covers the numerics fingerprint,
// the spec, the inputs and the index; for transfer the index is the cell and the numbers of its
// paths, so that a raised paths_per_cell keeps the full blocks that are there.
[[nodiscard]] core::Digest shard_digest(const Stage& stage, std::uint64_t shard,
                                        const core::Digest& fingerprint);

// Of all shards, by index.
[[nodiscard]] std::vector<core::Digest> shard_digests(const Stage& stage,
                                                      const core::Digest& fingerprint);

// Results of finished stages: for each, its shards' result blobs in index order.
struct StageResults {
  StageName name;
  std::vector<core::Digest> shards;
};

// The stages that can run now, given those that are finished (a job's graph grows as results come
// in: segments and cells are known only after the geometry and the grid). Empty when the job has
// nothing left to plan. Never names a stage that is in `finished`; the caller skips those it runs
// already. `read_blob` returns a result's bytes. Throws core::Error(kInvalidArgument) when the
// description is not canonical, kDataLoss when a result is malformed.
[[nodiscard]] std::vector<Stage> plan(
    const v1::FabricDescription& description, const std::vector<StageResults>& finished,
    const std::function<std::string(const core::Digest&)>& read_blob);

// The visibility shards whose results the basis is computed from, ascending: whole shards, chosen
// by the description's seed, with at most pca_sample_segments segments together (but one shard at
// least). All others are held out.
[[nodiscard]] std::vector<std::uint64_t> basis_sample(const v1::FabricDescription& description,
                                                      std::uint64_t visibility_shards);

// The seed from which the coefficients' spec has each segment's rotation.
[[nodiscard]] std::uint64_t rotation_seed(const v1::FabricDescription& description);

// All stages of a job, in the order people see them.
[[nodiscard]] std::vector<StageName> all_stages();

}  // namespace weft::coordinator
