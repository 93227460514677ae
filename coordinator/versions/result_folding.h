#pragma once

#include <functional>
#include <string>
#include <vector>

#include "coordinator/plan.h"
#include "core/digest.h"
#include "storage/fabric_database.h"
#include "storage/recolouring.h"

namespace weft::coordinator {

// A finished stage as it was planned, with its results in index order.
struct FinishedStage {
  Stage stage;
  std::vector<core::Digest> shards;
};

// Called by several threads at once.
using ReadBlob = std::function<std::string(const core::Digest&)>;

// Each of these folds the results of one stage into its part of the database, in index order. All
// throw core::Error(kDataLoss) naming stage and shard when a result is malformed: missing arrays,
// shapes other than the plan's, numbers that cannot be.

void fold_geometry(const FinishedStage& geometry, const ReadBlob& read_blob,
                   storage::FabricDatabase& database);
// REQUIRES: the geometry is folded.
void fold_grid(const FinishedStage& grid, const ReadBlob& read_blob,
               storage::FabricDatabase& database);
void fold_basis(const FinishedStage& basis, const ReadBlob& read_blob,
                storage::FabricDatabase& database);
// REQUIRES: the geometry, the grid and the basis are folded. `basis_shards`, ascending, are those
// that the basis was made from: the sign error is taken from the others, or from all where there
// are no others.
void fold_coefficients(const FinishedStage& coefficients,
                       const std::vector<std::uint64_t>& basis_shards, const ReadBlob& read_blob,
                       storage::FabricDatabase& database);
// Fits the filter of shadows; with no light in the bins it is two mean free paths, which nothing
// reads. Returns what the fit gets wrong (shading/shadow_fit.h). REQUIRES: the grid is folded.
double fold_shadow(const FinishedStage& shadow, const ReadBlob& read_blob,
                   storage::FabricDatabase& database);
// REQUIRES: the grid is folded.
void fold_transfer(const FinishedStage& transfer, const ReadBlob& read_blob,
                   storage::FabricDatabase& database, storage::Recolouring& recolouring);

}  // namespace weft::coordinator
