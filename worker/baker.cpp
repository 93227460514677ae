#include "worker/baker.h"

#include <utility>

#include "core/error.h"
#include "transport/float_mode.h"
#include "worker/bakers.h"

namespace weft::worker {

namespace {

std::unique_ptr<Baker> make_baker_of_kind(const BakerContext& context) {
  switch (context.spec.kind_case()) {
    case v1::TaskSpec::kGeometry:
      return make_geometry_baker(context);
    case v1::TaskSpec::kGrid:
      return make_grid_baker(context);
    case v1::TaskSpec::kVisibility:
      return make_visibility_baker(context);
    case v1::TaskSpec::kBasis:
      return make_basis_baker(context);
    case v1::TaskSpec::kCoefficients:
      return make_coefficients_baker(context);
    case v1::TaskSpec::kTransfer:
      return make_transfer_baker(context);
    case v1::TaskSpec::kShadow:
      return make_shadow_baker(context);
    case v1::TaskSpec::KIND_NOT_SET:
      break;
  }
  throw core::Error(core::Code::kInvalidArgument,
                    "the task is of a kind that this worker does not know; is the worker older "
                    "than the coordinator?");
}

// Bakes with denormals flushed, whatever mode the calling thread is in: results must not depend on
// who calls.
class OneFloatMode : public Baker {
 public:
  explicit OneFloatMode(std::unique_ptr<Baker> baker) : baker_(std::move(baker)) {}

  std::string bake(std::uint64_t shard, const std::string& shard_input,
                   const std::function<bool()>& should_stop) const override {
    const transport::FlushDenormals flush;
    return baker_->bake(shard, shard_input, should_stop);
  }

 private:
  std::unique_ptr<Baker> baker_;
};

}  // namespace

std::unique_ptr<Baker> make_baker(BakerContext context) {
  const transport::FlushDenormals flush;
  return std::make_unique<OneFloatMode>(make_baker_of_kind(context));
}

transport::Checkpoint stop_point(const std::function<bool()>& should_stop) {
  return [&should_stop] {
    if (should_stop && should_stop()) {
      throw core::Error(core::Code::kCancelled, "the task was told to stop");
    }
  };
}

void require(bool condition, const char* kind, const char* what) {
  if (!condition) {
    throw core::Error(core::Code::kInvalidArgument, std::string("the ") + kind + " task: " + what);
  }
}

void require_inputs(const BakerContext& context, const char* kind, std::size_t count) {
  if (context.inputs.size() != count) {
    throw core::Error(core::Code::kInvalidArgument, std::string("the ") + kind + " task has " +
                                                        std::to_string(context.inputs.size()) +
                                                        " inputs where " + std::to_string(count) +
                                                        " were expected");
  }
}

void require_shard(std::uint64_t shard, std::uint64_t shard_count) {
  if (shard >= shard_count) {
    throw core::Error(core::Code::kInvalidArgument, "shard " + std::to_string(shard) +
                                                        " does not exist: the stage has " +
                                                        std::to_string(shard_count));
  }
}

void require_resolution(std::uint32_t resolution, const char* kind) {
  require(resolution > 0 && resolution <= 1024 && resolution % 8 == 0, kind,
          "resolution must be a multiple of 8 between 8 and 1024");
}

}  // namespace weft::worker
