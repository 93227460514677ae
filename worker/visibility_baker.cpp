#include <span>
#include <vector>

#include "proto/arrays.h"
#include "transport/visibility_raster.h"
#include "worker/bakers.h"
#include "worker/tile_scene.h"

namespace weft::worker {

namespace {

class VisibilityBaker : public Baker {
 public:
  explicit VisibilityBaker(const BakerContext& context)
      : resolution_(context.spec.visibility().resolution()), shard_count_(context.shard_count) {
    require_inputs(context, "visibility", 1);
    require_resolution(resolution_, "visibility");
    input_ = tile_scene(context.inputs[0]);
    raster_ = std::make_unique<transport::VisibilityRaster>(input_->scene, resolution_);
  }

  std::string bake(std::uint64_t shard, const std::string& /*shard_input*/,
                   const std::function<bool()>& should_stop) const override {
    require_shard(shard, shard_count_);
    std::vector<std::uint8_t> bits;
    std::uint64_t count = 0;
    for (std::uint64_t k = shard; k < input_->tile.segment_count(); k += shard_count_, ++count) {
      const std::vector<std::uint8_t> image =
          raster_->bits(static_cast<std::uint32_t>(k), stop_point(should_stop));
      bits.insert(bits.end(), image.begin(), image.end());
    }
    v1::Arrays arrays;
    v1::add_array<std::uint8_t>(arrays, "bits",
                                {count, std::uint64_t{resolution_} * resolution_ / 8}, bits);
    return v1::serialize(arrays);
  }

 private:
  std::uint32_t resolution_;
  std::uint64_t shard_count_;
  std::shared_ptr<const TileScene> input_;
  std::unique_ptr<transport::VisibilityRaster> raster_;  // reads input_
};

}  // namespace

std::unique_ptr<Baker> make_visibility_baker(const BakerContext& context) {
  return std::make_unique<VisibilityBaker>(context);
}

}  // namespace weft::worker
