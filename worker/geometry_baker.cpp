#include "fabric/build.h"
#include "worker/bakers.h"

namespace weft::worker {

namespace {

class GeometryBaker : public Baker {
 public:
  explicit GeometryBaker(const BakerContext& context) : context_(context) {
    require_inputs(context, "geometry", 0);
  }

  std::string bake(std::uint64_t shard, const std::string& /*shard_input*/,
                   const std::function<bool()>& should_stop) const override {
    require_shard(shard, context_.shard_count);
    transport::pass(stop_point(should_stop));
    const fabric::Tile tile = fabric::build_tile(context_.spec.geometry().description(),
                                                 {.most_threads = context_.most_threads});
    transport::pass(stop_point(should_stop));
    return fabric::encode_tile(tile);
  }

 private:
  BakerContext context_;
};

}  // namespace

std::unique_ptr<Baker> make_geometry_baker(const BakerContext& context) {
  return std::make_unique<GeometryBaker>(context);
}

}  // namespace weft::worker
