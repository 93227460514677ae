#include "coordinator/plan.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "core/random.h"
#include "core/stopping.h"
#include "fabric/description.h"
#include "fabric/tile.h"
#include "proto/arrays.h"

namespace weft::coordinator {

namespace {

constexpr std::uint64_t kSegmentsPerShard = 64;
constexpr std::uint32_t kPathsPerShard = 16'384;
constexpr std::uint32_t kShadowPathsPerShard = 4096;
// Light that travels farther than 16 mean free paths is beyond all that is fitted.
constexpr std::uint32_t kShadowBins = 256;
constexpr double kShadowBinMfp = 1.0 / 16;

// Enters every shard's digest. Raised when a baker gives other bytes for the same spec and inputs,
// so that results of the older program are not taken for the newer one's.
constexpr std::uint64_t kResultsRevision = 4;

// What the description's one seed is used for; the numbers are part of every result.
enum class Purpose : std::uint32_t {
  kGrid = 0x101,
  kBasisSample = 0x102,
  kBasis = 0x103,
  kRotation = 0x104,
  kTransfer = 0x105,
  kShadow = 0x106,
};

std::uint64_t seed_for(const v1::FabricDescription& description, Purpose purpose) {
  return core::derive_seed(description.seed(), static_cast<std::uint32_t>(purpose));
}

// Free flights from which the mean free path is estimated: its relative error is about
// 1 / sqrt(hits), so 0.4 %, 0.2 % and 0.1 %.
std::uint32_t grid_rays(v1::Quality quality) {
  switch (quality) {
    case v1::QUALITY_PREVIEW:
      return 1U << 16;
    case v1::QUALITY_BEST:
      return 1U << 20;
    default:
      return 1U << 18;
  }
}

// A cell's segments are drawn by these counts: thousands for a cell together.
constexpr std::uint32_t kSeenRaysPerSegment = 16;

// Paths from which the spread of shadows is fitted: 1 to 0.2 %.
std::uint32_t shadow_paths(v1::Quality quality) {
  switch (quality) {
    case v1::QUALITY_PREVIEW:
      return 1U << 14;
    case v1::QUALITY_BEST:
      return 1U << 18;
    default:
      return 1U << 16;
  }
}

// What a tile's arrays, the scene of its strands and the hierarchy over them take for a segment,
// rounded up to a power of two; the base is for the program and the results.
constexpr std::uint64_t kSceneBytesPerSegment = 512;
constexpr std::uint64_t kBaseMemoryBytes = std::uint64_t{64} << 20;

std::uint64_t scene_memory(const fabric::Tile& tile) {
  return kBaseMemoryBytes + tile.segment_count() * kSceneBytesPerSegment;
}

// Of the map of directions, in floats.
std::uint64_t map_bytes(std::uint64_t resolution) { return resolution * resolution * 4; }

std::uint64_t ceil_div(std::uint64_t count, std::uint64_t divisor) {
  return (count + divisor - 1) / divisor;
}

// A setting of a canonical description, which has all of them.
template <class T>
T expanded(T value, const char* field) {
  if (value == T{}) {
    throw core::Error(core::Code::kInvalidArgument,
                      std::string("precompute.") + field +
                          " is not set: the description is not canonical; read it with "
                          "load_description, which expands defaults");
  }
  return value;
}

const StageResults* find(const std::vector<StageResults>& finished, StageName name) {
  for (const StageResults& results : finished) {
    if (results.name == name) {
      return &results;
    }
  }
  return nullptr;
}

const core::Digest& only_shard(const StageResults& results) {
  CHECK_EQ(results.shards.size(), 1U);
  return results.shards.front();
}

Stage make_stage(StageName name, std::uint64_t shard_count, std::vector<core::Digest> inputs) {
  Stage stage;
  stage.name = name;
  stage.shard_count = shard_count;
  stage.inputs = std::move(inputs);
  return stage;
}

Stage geometry_stage(const v1::FabricDescription& description) {
  Stage stage = make_stage(StageName::kGeometry, 1, {});
  *stage.spec.mutable_geometry()->mutable_description() = fabric::geometry_part(description);
  return stage;
}

Stage grid_stage(const v1::FabricDescription& description, const core::Digest& tile) {
  const v1::Precompute& settings = description.precompute();
  Stage stage = make_stage(StageName::kGrid, 1, {tile});
  v1::GridSpec& spec = *stage.spec.mutable_grid();
  spec.set_cell_length_mfp(expanded(settings.cell_length_mfp(), "cell_length_mfp"));
  spec.set_rays(grid_rays(settings.quality()));
  spec.set_seed(seed_for(description, Purpose::kGrid));
  spec.set_seen_rays_per_segment(kSeenRaysPerSegment);
  return stage;
}

Stage visibility_stage(const v1::FabricDescription& description, const core::Digest& tile_digest,
                       const fabric::Tile& tile) {
  Stage stage = make_stage(StageName::kVisibility,
                           ceil_div(tile.segment_count(), kSegmentsPerShard), {tile_digest});
  stage.spec.mutable_visibility()->set_resolution(
      expanded(description.precompute().visibility_resolution(), "visibility_resolution"));
  stage.memory_bytes = scene_memory(tile);
  return stage;
}

Stage basis_stage(const v1::FabricDescription& description, const StageResults& visibility) {
  const v1::Precompute& settings = description.precompute();
  Stage stage = make_stage(StageName::kBasis, 1, {});
  v1::BasisSpec& spec = *stage.spec.mutable_basis();
  spec.set_resolution(expanded(settings.visibility_resolution(), "visibility_resolution"));
  spec.set_components(expanded(settings.pca_components(), "pca_components"));
  spec.set_seed(seed_for(description, Purpose::kBasis));
  for (const std::uint64_t shard : basis_sample(description, visibility.shards.size())) {
    stage.inputs.push_back(visibility.shards[shard]);
  }
  // The distances of the sampled segments, and a copy that is worked on.
  stage.memory_bytes =
      kBaseMemoryBytes + 2 * stage.inputs.size() * kSegmentsPerShard * map_bytes(spec.resolution());
  return stage;
}

Stage coefficients_stage(const v1::FabricDescription& description, const core::Digest& basis,
                         const StageResults& visibility) {
  const v1::Precompute& settings = description.precompute();
  Stage stage = make_stage(StageName::kCoefficients, visibility.shards.size(), {basis});
  stage.shard_inputs = visibility.shards;
  v1::CoefficientsSpec& spec = *stage.spec.mutable_coefficients();
  spec.set_resolution(expanded(settings.visibility_resolution(), "visibility_resolution"));
  spec.set_sg_count(expanded(settings.sg_count(), "sg_count"));
  spec.set_sg_sharpness(expanded(settings.sg_sharpness(), "sg_sharpness"));
  spec.set_rotation_seed(rotation_seed(description));
  return stage;
}

// The description's material of that name, without what paths do not read.
v1::Material optics_of(const v1::FabricDescription& description, const std::string& name) {
  for (const v1::Material& material : description.materials()) {
    if (material.name() == name) {
      v1::Material optics = material;
      optics.clear_name();
      optics.clear_preset();
      return optics;
    }
  }
  throw core::Error(core::Code::kInvalidArgument,
                    "the fibres are made of material '" + name +
                        "', which the description does not define; add it to materials");
}

// A cell that may stop early is one shard: its paths are worked through in order.
std::uint32_t paths_of_whole_cell(const v1::TransferSpec& spec) {
  if (spec.paths_per_cell() > core::kMostStoppingPaths) {
    throw core::Error(core::Code::kInvalidArgument,
                      "precompute.paths_per_cell is " + std::to_string(spec.paths_per_cell()) +
                          "; with a target_standard_error at most " +
                          std::to_string(core::kMostStoppingPaths) + " are possible");
  }
  return spec.paths_per_cell();
}

Stage transfer_stage(const v1::FabricDescription& description,
                     const std::vector<core::Digest>& inputs, const fabric::Tile& tile,
                     const std::string& grid) {
  const v1::Precompute& settings = description.precompute();
  Stage stage = make_stage(StageName::kTransfer, 0, inputs);
  v1::TransferSpec& spec = *stage.spec.mutable_transfer();
  spec.set_sh_order(settings.sh_order());  // 0 is an order too
  spec.set_paths_per_cell(expanded(settings.paths_per_cell(), "paths_per_cell"));
  spec.set_target_standard_error(settings.target_standard_error());
  spec.set_paths_per_shard(spec.target_standard_error() > 0 ? paths_of_whole_cell(spec)
                                                            : kPathsPerShard);
  spec.set_estimator(settings.transfer_estimator() == v1::TRANSFER_ESTIMATOR_UNSPECIFIED
                         ? v1::TRANSFER_ESTIMATOR_EXIT
                         : settings.transfer_estimator());
  for (const std::string& name : tile.material_names) {
    *spec.add_materials() = optics_of(description, name);
  }
  spec.set_seed(seed_for(description, Purpose::kTransfer));
  spec.set_max_path_length(expanded(settings.max_path_length(), "max_path_length"));

  std::vector<std::uint64_t> shape;
  (void)v1::array_of<std::uint32_t>(v1::parse_arrays(grid), "cell_coordinates", &shape);
  if (shape.size() != 2 || shape[0] == 0 || shape[1] != 3) {
    throw core::Error(core::Code::kDataLoss, "the grid's cell_coordinates are not [cells, 3]");
  }
  const std::uint64_t shards_of_cell = ceil_div(spec.paths_per_cell(), spec.paths_per_shard());
  if (shards_of_cell > kStageShardsLimit / shape[0]) {
    throw core::Error(core::Code::kInvalidArgument,
                      "stage_shards_limit: " + std::to_string(shape[0]) + " cells of " +
                          std::to_string(shards_of_cell) + " shards each are more than " +
                          std::to_string(kStageShardsLimit) + "; lower precompute.paths_per_cell");
  }
  stage.shard_count = shape[0] * shards_of_cell;
  stage.memory_bytes = scene_memory(tile);
  return stage;
}

Stage shadow_stage(const v1::FabricDescription& description,
                   const std::vector<core::Digest>& inputs, const fabric::Tile& tile) {
  const v1::Precompute& settings = description.precompute();
  Stage stage = make_stage(StageName::kShadow, 0, inputs);
  v1::ShadowSpec& spec = *stage.spec.mutable_shadow();
  spec.set_paths(shadow_paths(settings.quality()));
  spec.set_paths_per_shard(kShadowPathsPerShard);
  for (const std::string& name : tile.material_names) {
    *spec.add_materials() = optics_of(description, name);
  }
  spec.set_seed(seed_for(description, Purpose::kShadow));
  spec.set_max_path_length(expanded(settings.max_path_length(), "max_path_length"));
  spec.set_bins(kShadowBins);
  spec.set_bin_mfp(kShadowBinMfp);
  stage.shard_count = ceil_div(spec.paths(), spec.paths_per_shard());
  stage.memory_bytes = scene_memory(tile);
  return stage;
}

// The part of a stage's spec that all its shards are named by. Paths are numbered within their
// cell, so a shard of transfer is named by its cell and its paths: raising paths_per_cell leaves
// the digests of all full blocks as they are.
std::string naming_spec(const Stage& stage) {
  v1::TaskSpec named = stage.spec;
  if (named.has_transfer()) {
    named.mutable_transfer()->clear_paths_per_cell();
    named.mutable_transfer()->clear_paths_per_shard();
  }
  return v1::canonical_bytes(named);
}

void name_transfer_shard(core::Hasher& hasher, const v1::TransferSpec& spec, std::uint64_t shard) {
  const std::uint64_t blocks = ceil_div(spec.paths_per_cell(), spec.paths_per_shard());
  const std::uint64_t first_path = shard % blocks * spec.paths_per_shard();
  const std::uint64_t paths =
      std::min<std::uint64_t>(spec.paths_per_shard(), spec.paths_per_cell() - first_path);
  hasher.number(shard / blocks);
  hasher.number(first_path);
  hasher.number(paths);
}

core::Digest name_shard(const Stage& stage, const std::string& spec, std::uint64_t shard,
                        const core::Digest& fingerprint) {
  core::Hasher hasher;
  hasher.field("weft.shard");
  hasher.number(kResultsRevision);
  hasher.bytes(fingerprint.binary());
  hasher.number(stage.inputs.size());
  for (const core::Digest& input : stage.inputs) {
    hasher.bytes(input.binary());
  }
  hasher.field(spec);
  if (stage.spec.has_transfer()) {
    name_transfer_shard(hasher, stage.spec.transfer(), shard);
    return hasher.finish();
  }
  hasher.number(stage.shard_count);
  hasher.number(shard);
  if (!stage.shard_inputs.empty()) {
    hasher.bytes(stage.shard_inputs[shard].binary());
  }
  return hasher.finish();
}

}  // namespace

const char* to_string(StageName name) {
  switch (name) {
    case StageName::kGeometry:
      return "geometry";
    case StageName::kGrid:
      return "grid";
    case StageName::kVisibility:
      return "visibility";
    case StageName::kBasis:
      return "basis";
    case StageName::kCoefficients:
      return "coefficients";
    case StageName::kTransfer:
      return "transfer";
    case StageName::kShadow:
      return "shadow";
  }
  return "unknown";
}

std::vector<StageName> all_stages() {
  return {StageName::kGeometry,     StageName::kGrid,     StageName::kVisibility, StageName::kBasis,
          StageName::kCoefficients, StageName::kTransfer, StageName::kShadow};
}

std::vector<std::uint64_t> basis_sample(const v1::FabricDescription& description,
                                        std::uint64_t visibility_shards) {
  const std::uint64_t wanted =
      expanded(description.precompute().pca_sample_segments(), "pca_sample_segments");
  const std::uint64_t count =
      std::min(visibility_shards, std::max<std::uint64_t>(1, wanted / kSegmentsPerShard));
  // The first `count` places of a shuffle (Fisher and Yates).
  std::vector<std::uint64_t> shards(visibility_shards);
  std::iota(shards.begin(), shards.end(), std::uint64_t{0});
  core::Random random(seed_for(description, Purpose::kBasisSample), 0);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t j = i + random.below(static_cast<std::uint32_t>(visibility_shards - i));
    std::swap(shards[i], shards[j]);
  }
  shards.resize(count);
  std::sort(shards.begin(), shards.end());
  return shards;
}

std::uint64_t rotation_seed(const v1::FabricDescription& description) {
  return seed_for(description, Purpose::kRotation);
}

core::Digest shard_digest(const Stage& stage, std::uint64_t shard,
                          const core::Digest& fingerprint) {
  CHECK_LT(shard, stage.shard_count);
  return name_shard(stage, naming_spec(stage), shard, fingerprint);
}

std::vector<core::Digest> shard_digests(const Stage& stage, const core::Digest& fingerprint) {
  const std::string spec = naming_spec(stage);
  std::vector<core::Digest> digests;
  digests.reserve(stage.shard_count);
  for (std::uint64_t shard = 0; shard < stage.shard_count; ++shard) {
    digests.push_back(name_shard(stage, spec, shard, fingerprint));
  }
  return digests;
}

std::vector<Stage> plan(const v1::FabricDescription& description,
                        const std::vector<StageResults>& finished,
                        const std::function<std::string(const core::Digest&)>& read_blob) {
  const StageResults* const geometry = find(finished, StageName::kGeometry);
  if (geometry == nullptr) {
    return {geometry_stage(description)};
  }
  const core::Digest tile_digest = only_shard(*geometry);
  const StageResults* const grid = find(finished, StageName::kGrid);
  const StageResults* const visibility = find(finished, StageName::kVisibility);
  const StageResults* const basis = find(finished, StageName::kBasis);
  const bool transfer_next = grid != nullptr && find(finished, StageName::kTransfer) == nullptr;
  fabric::Tile tile;
  const bool shadow_next = grid != nullptr && find(finished, StageName::kShadow) == nullptr;
  if (visibility == nullptr || transfer_next || shadow_next) {
    tile = fabric::decode_tile(read_blob(tile_digest));
  }

  std::vector<Stage> stages;
  if (grid == nullptr) {
    stages.push_back(grid_stage(description, tile_digest));
  }
  if (visibility == nullptr) {
    stages.push_back(visibility_stage(description, tile_digest, tile));
  } else if (basis == nullptr) {
    stages.push_back(basis_stage(description, *visibility));
  } else if (find(finished, StageName::kCoefficients) == nullptr) {
    stages.push_back(coefficients_stage(description, only_shard(*basis), *visibility));
  }
  if (transfer_next) {
    const core::Digest& grid_digest = only_shard(*grid);
    stages.push_back(
        transfer_stage(description, {tile_digest, grid_digest}, tile, read_blob(grid_digest)));
  }
  if (shadow_next) {
    stages.push_back(shadow_stage(description, {tile_digest, only_shard(*grid)}, tile));
  }
  return stages;
}

}  // namespace weft::coordinator
