#pragma once

#include <functional>
#include <memory>
#include <string>

#include "transport/checkpoint.h"
#include "worker/baker.h"

// One baker per kind of task; make_baker chooses. Each throws core::Error(kInvalidArgument) on a
// spec that makes no sense and kDataLoss on damaged inputs.
namespace weft::worker {

[[nodiscard]] std::unique_ptr<Baker> make_geometry_baker(const BakerContext& context);
[[nodiscard]] std::unique_ptr<Baker> make_grid_baker(const BakerContext& context);
[[nodiscard]] std::unique_ptr<Baker> make_visibility_baker(const BakerContext& context);
[[nodiscard]] std::unique_ptr<Baker> make_basis_baker(const BakerContext& context);
[[nodiscard]] std::unique_ptr<Baker> make_coefficients_baker(const BakerContext& context);
[[nodiscard]] std::unique_ptr<Baker> make_transfer_baker(const BakerContext& context);
[[nodiscard]] std::unique_ptr<Baker> make_shadow_baker(const BakerContext& context);

// Throws core::Error(kCancelled) from within long work when `should_stop` says so.
[[nodiscard]] transport::Checkpoint stop_point(const std::function<bool()>& should_stop);

// Throws core::Error(kInvalidArgument): "the KIND task: what".
void require(bool condition, const char* kind, const char* what);

// Throws unless the stage has `count` inputs and the shard is one of its shards.
void require_inputs(const BakerContext& context, const char* kind, std::size_t count);
void require_shard(std::uint64_t shard, std::uint64_t shard_count);

// What a visibility image may measure: a positive multiple of 8, at most 1024.
void require_resolution(std::uint32_t resolution, const char* kind);

}  // namespace weft::worker
