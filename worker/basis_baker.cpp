#include <algorithm>
#include <span>
#include <vector>

#include "proto/arrays.h"
#include "transport/clamped_distance.h"
#include "transport/pca.h"
#include "worker/bakers.h"
#include "worker/visibility_images.h"

namespace weft::worker {

namespace {

constexpr std::uint32_t kMaxComponents = 1024;

class BasisBaker : public Baker {
 public:
  explicit BasisBaker(const BakerContext& context)
      : spec_(context.spec.basis()), shard_count_(context.shard_count) {
    require(!context.inputs.empty(), "basis", "there is no visibility result to analyse");
    require_resolution(spec_.resolution(), "basis");
    require(spec_.components() > 0 && spec_.components() <= kMaxComponents, "basis",
            "components must be between 1 and 1024");
    for (const std::string& input : context.inputs) {
      visibility_.emplace_back(input, spec_.resolution());
    }
  }

  std::string bake(std::uint64_t shard, const std::string& /*shard_input*/,
                   const std::function<bool()>& should_stop) const override {
    require_shard(shard, shard_count_);
    const transport::Checkpoint checkpoint = stop_point(should_stop);
    const std::uint32_t pixels = spec_.resolution() * spec_.resolution();
    const transport::ClampedDistances clamped(spec_.resolution());
    std::vector<float> distances(varied_images() * pixels);
    std::size_t next = 0;
    for (const VisibilityImages& images : visibility_) {
      transport::pass(checkpoint);
      for (std::size_t i = 0; i < images.count(); ++i) {
        if (is_uniform(images.image(i))) {
          continue;
        }
        clamped.measure(images.image(i), std::span(distances).subspan(next, pixels));
        next += pixels;
      }
    }
    const transport::DistanceBasis basis = transport::principal_components(
        distances, pixels, spec_.components(), spec_.seed(), checkpoint);
    v1::Arrays arrays;
    v1::add_array<float>(arrays, "mean", {pixels}, basis.mean);
    v1::add_array<float>(arrays, "components", {spec_.components(), pixels}, basis.components);
    v1::add_array<float>(arrays, "variance", {spec_.components()}, basis.variance);
    return v1::serialize(arrays);
  }

 private:
  // Uniform images are told apart by open_share. In dense cloth they are most of all, and would
  // rule the components.
  [[nodiscard]] std::size_t varied_images() const {
    std::size_t count = 0;
    for (const VisibilityImages& images : visibility_) {
      for (std::size_t i = 0; i < images.count(); ++i) {
        count += is_uniform(images.image(i)) ? 0 : 1;
      }
    }
    return count;
  }

  v1::BasisSpec spec_;
  std::uint64_t shard_count_;
  std::vector<VisibilityImages> visibility_;
};

}  // namespace

std::unique_ptr<Baker> make_basis_baker(const BakerContext& context) {
  return std::make_unique<BasisBaker>(context);
}

}  // namespace weft::worker
