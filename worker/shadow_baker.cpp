#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "proto/arrays.h"
#include "transport/shadow_spread.h"
#include "worker/bakers.h"
#include "worker/materials.h"
#include "worker/tile_scene.h"

namespace weft::worker {

namespace {

// A bin holds sums of fixed point: 2^20 paths of the largest weight keep within it.
constexpr std::uint32_t kMostPathsPerShard = 1U << 20;
constexpr std::uint32_t kMostBins = 4096;

class ShadowBaker : public Baker {
 public:
  explicit ShadowBaker(const BakerContext& context)
      : spec_(context.spec.shadow()), shard_count_(context.shard_count) {
    require_inputs(context, "shadow", 2);
    require(spec_.paths() > 0, "shadow", "paths must be positive");
    require(spec_.paths_per_shard() > 0 && spec_.paths_per_shard() <= kMostPathsPerShard, "shadow",
            "paths_per_shard must be between 1 and 2^20");
    require(spec_.max_path_length() > 0, "shadow", "max_path_length must be positive");
    require(spec_.bins() > 0 && spec_.bins() <= kMostBins, "shadow",
            "bins must be between 1 and 4096");
    require(spec_.bin_mfp() > 0 && std::isfinite(spec_.bin_mfp()), "shadow",
            "bin_mfp must be positive");
    require(shard_count_ == (spec_.paths() + std::uint64_t{spec_.paths_per_shard()} - 1) /
                                spec_.paths_per_shard(),
            "shadow", "the number of shards is not that of the paths' blocks");
    input_ = tile_scene(context.inputs[0]);
    materials_ = bcsdfs_of(spec_.materials(), input_->tile, "shadow");
    const auto path_mm =
        v1::array_of<float>(v1::parse_arrays(context.inputs[1]), "mean_free_path_mm");
    if (path_mm.size() != 1 || !(path_mm[0] > 0) || !std::isfinite(path_mm[0])) {
      throw core::Error(core::Code::kDataLoss, "the grid has no mean free path");
    }
    settings_.seed = spec_.seed();
    settings_.max_path_length = spec_.max_path_length();
    settings_.bins = spec_.bins();
    settings_.bin_mm = spec_.bin_mfp() * static_cast<double>(path_mm[0]);
  }

  std::string bake(std::uint64_t shard, const std::string& /*shard_input*/,
                   const std::function<bool()>& should_stop) const override {
    require_shard(shard, shard_count_);
    const std::uint64_t first = shard * spec_.paths_per_shard();
    const std::uint64_t count =
        std::min<std::uint64_t>(spec_.paths_per_shard(), spec_.paths() - first);
    const transport::SpreadSums sums = transport::spread_sums(
        input_->scene, materials_, first, count, settings_, stop_point(should_stop));
    const std::array<std::uint64_t, 1> paths{sums.paths};
    v1::Arrays arrays;
    v1::add_array<std::uint64_t>(arrays, "paths", {1}, paths);
    v1::add_array<std::int64_t>(arrays, "sum", {sums.sum.size()}, sums.sum);
    return v1::serialize(arrays);
  }

 private:
  v1::ShadowSpec spec_;
  std::uint64_t shard_count_;
  std::shared_ptr<const TileScene> input_;
  std::vector<shading::FibreBcsdf> materials_;
  transport::SpreadSettings settings_;
};

}  // namespace

std::unique_ptr<Baker> make_shadow_baker(const BakerContext& context) {
  return std::make_unique<ShadowBaker>(context);
}

}  // namespace weft::worker
