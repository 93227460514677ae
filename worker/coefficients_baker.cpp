#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/half.h"
#include "proto/arrays.h"
#include "transport/distance_fit.h"
#include "transport/pca.h"
#include "transport/visibility_sg.h"
#include "worker/bakers.h"
#include "worker/visibility_images.h"

namespace weft::worker {

namespace {

constexpr std::size_t kTogether = 8;  // images between two looks at whether to stop

v1::Half half(float value) { return {core::half_from_float(value)}; }

// The share, never rounded to 0 or 1 when it is not: those two mean that all directions are alike.
v1::Half half_share(double share) {
  constexpr std::uint16_t kBelowOne = 0x3bff;
  const std::uint16_t bits = core::half_from_float(static_cast<float>(share));
  if (share > 0 && bits == 0) {
    return {1};
  }
  return {share < 1 ? std::min(bits, kBelowOne) : bits};
}

class CoefficientsBaker : public Baker {
 public:
  explicit CoefficientsBaker(const BakerContext& context)
      : spec_(context.spec.coefficients()), shard_count_(context.shard_count) {
    require_inputs(context, "coefficients", 1);
    require_resolution(spec_.resolution(), "coefficients");
    require(spec_.sg_count() > 0 && spec_.sg_count() <= 4096, "coefficients",
            "sg_count must be between 1 and 4096");
    const v1::Arrays arrays = v1::parse_arrays(context.inputs[0]);
    std::vector<std::uint64_t> shape;
    basis_.pixels = spec_.resolution() * spec_.resolution();
    basis_.mean = v1::array_of<float>(arrays, "mean");
    basis_.components = v1::array_of<float>(arrays, "components", &shape);
    basis_.variance = v1::array_of<float>(arrays, "variance");
    if (basis_.mean.size() != basis_.pixels || shape.size() != 2 ||
        shape[0] != basis_.variance.size() || shape[1] != basis_.pixels) {
      throw core::Error(core::Code::kDataLoss,
                        "the basis is not of the coefficients' resolution; their stages must have "
                        "the same setting");
    }
    fit_.emplace(basis_, spec_.resolution());
    regions_.emplace(spec_.sg_count(), spec_.resolution());
  }

  std::string bake(std::uint64_t shard, const std::string& shard_input,
                   const std::function<bool()>& should_stop) const override {
    require_shard(shard, shard_count_);
    const transport::Checkpoint checkpoint = stop_point(should_stop);
    const VisibilityImages images(shard_input, spec_.resolution());
    Result result;
    for (std::size_t i = 0; i < images.count(); i += kTogether) {
      transport::pass(checkpoint);
      add_ssdf(images, i, std::min(i + kTogether, images.count()), result);
    }
    for (std::size_t i = 0; i < images.count(); ++i) {
      transport::pass(checkpoint);
      const std::uint64_t segment = shard + i * shard_count_;
      add_ssg(images.image(i), static_cast<std::uint32_t>(segment), result);
    }
    const std::uint64_t n = images.count();
    v1::Arrays arrays;
    v1::add_array<v1::Half>(arrays, "ssdf", {n, basis_.variance.size()}, result.ssdf);
    v1::add_array<v1::Half>(arrays, "ssg", {n, spec_.sg_count()}, result.ssg);
    v1::add_array<std::uint32_t>(arrays, "rotation", {n}, result.rotation);
    v1::add_array<v1::Half>(arrays, "open_share", {n}, result.open_share);
    v1::add_array<std::uint32_t>(arrays, "sign_errors", {2}, result.sign_errors);
    return v1::serialize(arrays);
  }

 private:
  struct Result {
    std::vector<v1::Half> ssdf;
    std::vector<v1::Half> ssg;
    std::vector<std::uint32_t> rotation;
    std::vector<v1::Half> open_share;
    std::array<std::uint32_t, 2> sign_errors{0, 0};
  };

  // Coefficients in half precision of images first ... last - 1, and how many signs come out wrong
  // from these very halves. Uniform images, which open_share tells, have no coefficients and no
  // errors.
  void add_ssdf(const VisibilityImages& images, std::size_t first, std::size_t last,
                Result& result) const {
    std::vector<std::uint8_t> varied;
    for (std::size_t i = first; i < last; ++i) {
      if (!is_uniform(images.image(i))) {
        varied.insert(varied.end(), images.image(i).begin(), images.image(i).end());
      }
    }
    std::vector<float> coefficients = fit_->coefficients(varied);
    for (float& c : coefficients) {
      c = core::float_from_half(core::half_from_float(c));
    }
    result.sign_errors[0] +=
        static_cast<std::uint32_t>(transport::wrong_signs(basis_, varied, coefficients));
    result.sign_errors[1] += static_cast<std::uint32_t>(8 * varied.size());
    auto next = coefficients.begin();
    for (std::size_t i = first; i < last; ++i) {
      const bool is_varied = !is_uniform(images.image(i));
      for (std::size_t c = 0; c < basis_.variance.size(); ++c) {
        result.ssdf.push_back(half(is_varied ? *next++ : 0.0f));
      }
    }
  }

  void add_ssg(std::span<const std::uint8_t> image, std::uint32_t segment, Result& result) const {
    const std::uint16_t rotation =
        transport::sg_rotation(spec_.rotation_seed(), segment, spec_.resolution());
    for (const float w : regions_->weights(image, rotation)) {
      result.ssg.push_back(half(w));
    }
    result.rotation.push_back(rotation);
    result.open_share.push_back(half_share(transport::open_share(image, spec_.resolution())));
  }

  v1::CoefficientsSpec spec_;
  std::uint64_t shard_count_;
  transport::DistanceBasis basis_;
  std::optional<transport::DistanceFit> fit_;
  std::optional<transport::SgRegions> regions_;
};

}  // namespace

std::unique_ptr<Baker> make_coefficients_baker(const BakerContext& context) {
  return std::make_unique<CoefficientsBaker>(context);
}

}  // namespace weft::worker
