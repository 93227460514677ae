#pragma once

#include <vector>

#include "fabric/tile.h"
#include "google/protobuf/repeated_field.h"
#include "proto/weft/v1/fabric.pb.h"
#include "shading/fibre_bcsdf.h"

namespace weft::worker {

// The BCSDFs of a task's materials, which must be as many as the tile's. Throws
// core::Error(kInvalidArgument) naming the kind of task when a number makes no sense.
[[nodiscard]] std::vector<shading::FibreBcsdf> bcsdfs_of(
    const google::protobuf::RepeatedPtrField<v1::Material>& materials, const fabric::Tile& tile,
    const char* kind);

}  // namespace weft::worker
