#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "coordinator/plan.h"
#include "core/digest.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::coordinator {

// Folds the results of all stages, in index order, into a fabric database at `path` (written
// beside, verified, renamed). Returns its content digest. The same results give the same file, in
// whatever order and on whatever workers they were made. Throws core::Error(kDataLoss) naming the
// stage and shard when a result is malformed. `read_blob` is called by several threads at once.
core::Digest commit(const v1::FabricDescription& description,
                    const std::vector<StageResults>& results,
                    const std::function<std::string(const core::Digest&)>& read_blob,
                    const std::filesystem::path& path);

}  // namespace weft::coordinator
