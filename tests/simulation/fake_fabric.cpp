#include "tests/simulation/fake_fabric.h"

#include <algorithm>
#include <map>

#include "tests/simulation/timeline.h"

namespace weft::simulation {

namespace {

using coordinator::StageName;
using coordinator::StageResults;

const StageResults* find(const std::vector<StageResults>& finished, StageName name) {
  const auto found = std::find_if(finished.begin(), finished.end(),
                                  [&](const StageResults& stage) { return stage.name == name; });
  return found == finished.end() ? nullptr : &*found;
}

}  // namespace

std::vector<FakeStage> plan(const FakeFabric& fabric, const std::vector<StageResults>& finished,
                            const ReadBlob& read_blob) {
  std::vector<FakeStage> stages;
  const auto add = [&](StageName name, const std::string& spec, std::uint64_t shards,
                       std::vector<core::Digest> inputs) -> FakeStage* {
    if (find(finished, name) != nullptr) {
      return nullptr;
    }
    stages.push_back(
        {name, std::string(to_string(name)) + " " + spec, shards, std::move(inputs), {}});
    return &stages.back();
  };
  add(StageName::kGeometry, fabric.cloth, 1, {});
  const StageResults* const geometry = find(finished, StageName::kGeometry);
  if (geometry == nullptr) {
    return stages;
  }
  const core::Digest tile = geometry->shards.at(0);
  add(StageName::kGrid, "", 1, {tile});
  add(StageName::kVisibility, "", fabric.visibility_shards, {tile});
  const StageResults* const visibility = find(finished, StageName::kVisibility);
  if (visibility != nullptr) {
    add(StageName::kBasis, "", 1, {visibility->shards.front(), visibility->shards.back()});
  }
  const StageResults* const basis = find(finished, StageName::kBasis);
  if (basis != nullptr) {
    FakeStage* const coefficients =
        add(StageName::kCoefficients, "", fabric.visibility_shards, {basis->shards.at(0)});
    if (coefficients != nullptr) {
      coefficients->shard_inputs = visibility->shards;
    }
  }
  const StageResults* const grid = find(finished, StageName::kGrid);
  if (grid != nullptr) {
    // How many cells there are is known only from the grid.
    const std::string cells = read_blob(grid->shards.at(0));
    const std::uint64_t more = static_cast<std::uint8_t>(cells.back()) % 3;
    add(StageName::kTransfer, fabric.colour, fabric.transfer_shards + more,
        {tile, grid->shards.at(0)});
    add(StageName::kShadow, "", fabric.shadow_shards, {tile, grid->shards.at(0)});
  }
  return stages;
}

core::Digest work_of(const std::string& spec, std::span<const core::Digest> inputs,
                     const std::optional<core::Digest>& shard_input, std::uint64_t shard,
                     const core::Digest& fingerprint) {
  std::string text = spec + "/" + std::to_string(shard) + "/" + fingerprint.binary();
  for (const core::Digest& input : inputs) {
    text += input.binary();
  }
  if (shard_input) {
    text += '/';
    text += shard_input->binary();
  }
  return core::digest_of(text);
}

core::Digest work_of(const FakeStage& stage, std::uint64_t shard, const core::Digest& fingerprint) {
  const std::optional<core::Digest> input =
      stage.shard_inputs.empty() ? std::nullopt : std::optional(stage.shard_inputs.at(shard));
  return work_of(stage.spec, stage.inputs, input, shard, fingerprint);
}

std::string bake(const core::Digest& work) { return "result of " + work.hex(); }

core::Digest fold(const FakeFabric& fabric, const std::vector<StageResults>& finished,
                  const ReadBlob& read_blob) {
  core::Hasher hasher;
  hasher.field(fabric.cloth);
  hasher.field(fabric.colour);
  for (const StageName name : coordinator::all_stages()) {
    const StageResults* const stage = find(finished, name);
    if (stage == nullptr) {
      throw Violation(std::string("a database is to be made without ") + to_string(name));
    }
    hasher.field(to_string(name));
    for (const core::Digest& result : stage->shards) {
      hasher.field(read_blob(result));
    }
  }
  return hasher.finish();
}

core::Digest undisturbed(const FakeFabric& fabric, const core::Digest& fingerprint) {
  std::map<core::Digest, std::string> blobs;
  const ReadBlob read = [&](const core::Digest& digest) { return blobs.at(digest); };
  std::vector<StageResults> finished;
  for (;;) {
    const std::vector<FakeStage> stages = plan(fabric, finished, read);
    if (stages.empty()) {
      return fold(fabric, finished, read);
    }
    for (const FakeStage& stage : stages) {
      StageResults& results = finished.emplace_back();
      results.name = stage.name;
      for (std::uint64_t shard = 0; shard < stage.shard_count; ++shard) {
        const std::string bytes = bake(work_of(stage, shard, fingerprint));
        results.shards.push_back(core::digest_of(bytes));
        blobs[results.shards.back()] = bytes;
      }
    }
  }
}

}  // namespace weft::simulation
