#include "coordinator/versions/commit.h"

#include <algorithm>
#include <utility>

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "coordinator/versions/fibre_materials.h"
#include "coordinator/versions/result_folding.h"
#include "core/check.h"
#include "core/error.h"
#include "storage/light_tables.h"

namespace weft::coordinator {

namespace {

const char* const kSoftware = "weft, fabric database schema 1";

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  CHECK(google::protobuf::util::MessageToJsonString(message, &json, options).ok());
  return json;
}

// The results of a planned stage: one for each shard of the plan, or an error.
FinishedStage take_results(Stage stage, const std::vector<StageResults>& results) {
  const auto found = std::find_if(results.begin(), results.end(),
                                  [&stage](const StageResults& r) { return r.name == stage.name; });
  const std::string name = std::string("stage ") + to_string(stage.name);
  if (found == results.end()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      name + " has no results yet; commit when all stages are finished");
  }
  if (found->shards.size() != stage.shard_count) {
    throw core::Error(core::Code::kDataLoss,
                      name + " has " + std::to_string(found->shards.size()) + " results where " +
                          std::to_string(stage.shard_count) + " were planned; run the job again");
  }
  return {std::move(stage), found->shards};
}

// Folds a stage into `database`. Stages come in an order in which they can be planned, so those
// that this one needs are folded.
void fold(const FinishedStage& finished, const v1::FabricDescription& description,
          const ReadBlob& read_blob, storage::RecolourableDatabase& all, double& shadow_fit_error) {
  storage::FabricDatabase& database = all.database;
  switch (finished.stage.name) {
    case StageName::kGeometry:
      return fold_geometry(finished, read_blob, database);
    case StageName::kGrid:
      return fold_grid(finished, read_blob, database);
    case StageName::kVisibility:
      return;  // the coefficients hold what the file needs of it
    case StageName::kBasis:
      return fold_basis(finished, read_blob, database);
    case StageName::kCoefficients:
      return fold_coefficients(finished, basis_sample(description, finished.shards.size()),
                               read_blob, database);
    case StageName::kTransfer:
      for (const v1::Material& material : finished.stage.spec.transfer().materials()) {
        database.materials.push_back(fibre_material(material));
      }
      return fold_transfer(finished, read_blob, database, all.recolouring);
    case StageName::kShadow:
      shadow_fit_error = fold_shadow(finished, read_blob, database);
      return;
  }
  core::check_failed(__FILE__, __LINE__, "unknown stage");
}

// One digest for all results of a stage.
core::Digest digest_of_results(const FinishedStage& finished) {
  core::Hasher hasher;
  for (const core::Digest& shard : finished.shards) {
    hasher.bytes(shard.binary());
  }
  return hasher.finish();
}

std::string stages_json(const std::vector<FinishedStage>& stages, double shadow_fit_error) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const StageName name : all_stages()) {
    const auto found = std::find_if(stages.begin(), stages.end(), [name](const FinishedStage& s) {
      return s.stage.name == name;
    });
    CHECK(found != stages.end());
    nlohmann::ordered_json entry;
    entry["name"] = to_string(name);
    entry["shards"] = found->shards.size();
    entry["results_sha256"] = digest_of_results(*found).hex();
    if (name != StageName::kGeometry) {  // that one's is the description itself
      entry["spec"] = nlohmann::ordered_json::parse(json_of(found->stage.spec));
    }
    if (name == StageName::kShadow) {
      entry["fit_error"] = shadow_fit_error;
    }
    list.push_back(entry);
  }
  return nlohmann::ordered_json{{"stages", list}}.dump();
}

}  // namespace

core::Digest commit(const v1::FabricDescription& description,
                    const std::vector<StageResults>& results,
                    const std::function<std::string(const core::Digest&)>& read_blob,
                    const std::filesystem::path& path) {
  // The job is planned again, stage by stage: what is merged is what the plan says.
  storage::RecolourableDatabase all;
  storage::FabricDatabase& database = all.database;
  double shadow_fit_error = 0;
  std::vector<FinishedStage> stages;
  std::vector<StageResults> finished;
  for (std::vector<Stage> planned = plan(description, finished, read_blob); !planned.empty();
       planned = plan(description, finished, read_blob)) {
    for (Stage& stage : planned) {
      stages.push_back(take_results(std::move(stage), results));
      fold(stages.back(), description, read_blob, all, shadow_fit_error);
      finished.push_back({stages.back().stage.name, stages.back().shards});
    }
  }
  database.c_s = storage::scattering_tables(database.materials, database.sh_order);
  database.description_json = json_of(description);
  database.stages_json = stages_json(stages, shadow_fit_error);
  database.software = kSoftware;
  return storage::write_database(database, all.recolouring, path);
}

}  // namespace weft::coordinator
