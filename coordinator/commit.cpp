#include "coordinator/commit.h"

#include <algorithm>
#include <numbers>

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "coordinator/result_folding.h"
#include "core/check.h"
#include "core/error.h"
#include "storage/light_tables.h"

namespace weft::coordinator {

namespace {

// The filter of multiple-scattering shadows, in mean free paths: an assumption until the constant
// is fitted to paths traced across a shadow's edge (docs/database_format.md, /cells).
constexpr float kShadowSigmaMfp = 2.0F;

const char* const kSoftware = "weft, fabric database schema 1";

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  CHECK(google::protobuf::util::MessageToJsonString(message, &json, options).ok());
  return json;
}

// Plans the job again, stage by stage, and takes each stage's results as it comes up: what is
// merged is what the plan says, or an error.
std::vector<FinishedStage> match_plan(const v1::FabricDescription& description,
                                      const std::vector<StageResults>& results,
                                      const ReadBlob& read_blob) {
  std::vector<FinishedStage> matched;
  std::vector<StageResults> finished;
  for (std::vector<Stage> stages = plan(description, finished, read_blob); !stages.empty();
       stages = plan(description, finished, read_blob)) {
    for (Stage& stage : stages) {
      const auto found =
          std::find_if(results.begin(), results.end(),
                       [&stage](const StageResults& r) { return r.name == stage.name; });
      const std::string name = std::string("stage ") + to_string(stage.name);
      if (found == results.end()) {
        throw core::Error(core::Code::kFailedPrecondition,
                          name + " has no results yet; commit when all stages are finished");
      }
      if (found->shards.size() != stage.shard_count) {
        throw core::Error(core::Code::kDataLoss,
                          name + " has " + std::to_string(found->shards.size()) +
                              " results where " + std::to_string(stage.shard_count) +
                              " were planned; run the job again");
      }
      finished.push_back(*found);
      matched.push_back({std::move(stage), found->shards});
    }
  }
  return matched;
}

const FinishedStage& stage_named(const std::vector<FinishedStage>& stages, StageName name) {
  const auto found = std::find_if(stages.begin(), stages.end(),
                                  [name](const FinishedStage& s) { return s.stage.name == name; });
  CHECK(found != stages.end());
  return *found;
}

shading::FibreMaterial fibre_material(const v1::Material& material) {
  const auto colour = [](const v1::Rgb& rgb) { return glm::vec3(rgb.r(), rgb.g(), rgb.b()); };
  const auto radians = [](double degrees) {
    return static_cast<float>(degrees * std::numbers::pi / 180);
  };
  return {colour(material.c_r()), colour(material.c_tt()), radians(material.beta_r_deg()),
          radians(material.beta_tt_deg()), radians(material.gamma_tt_deg())};
}

// One digest for all results of a stage.
core::Digest digest_of_results(const FinishedStage& finished) {
  core::Hasher hasher;
  for (const core::Digest& shard : finished.shards) {
    hasher.bytes(shard.binary());
  }
  return hasher.finish();
}

std::string stages_json(const std::vector<FinishedStage>& stages) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const FinishedStage& finished : stages) {
    nlohmann::ordered_json entry;
    entry["name"] = to_string(finished.stage.name);
    entry["shards"] = finished.shards.size();
    entry["results_sha256"] = digest_of_results(finished).hex();
    if (!finished.stage.spec.has_geometry()) {  // that one is the description itself
      entry["spec"] = nlohmann::ordered_json::parse(json_of(finished.stage.spec));
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
  const std::vector<FinishedStage> stages = match_plan(description, results, read_blob);
  const FinishedStage& geometry = stage_named(stages, StageName::kGeometry);
  const FinishedStage& coefficients = stage_named(stages, StageName::kCoefficients);
  const FinishedStage& transfer = stage_named(stages, StageName::kTransfer);

  storage::FabricDatabase database;
  fold_tile(fabric::decode_tile(read_blob(geometry.shards.front())), database);
  fold_grid(stage_named(stages, StageName::kGrid), read_blob, database);
  fold_basis(stage_named(stages, StageName::kBasis), read_blob, database);
  fold_coefficients(coefficients, basis_sample(description, coefficients.shards.size()), read_blob,
                    database);
  fold_transfer(transfer, read_blob, database);

  for (const v1::Material& material : transfer.stage.spec.transfer().materials()) {
    database.materials.push_back(fibre_material(material));
  }
  database.c_s = storage::scattering_tables(database.materials, database.sh_order);
  database.sigma_shadow_mm = kShadowSigmaMfp * database.mean_free_path_mm;
  database.description_json = json_of(description);
  database.stages_json = stages_json(stages);
  database.software = kSoftware;
  return storage::write_database(database, path);
}

}  // namespace weft::coordinator
