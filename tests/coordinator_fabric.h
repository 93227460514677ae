#pragma once

#include <array>
#include <map>
#include <string>

#include "coordinator/plan.h"
#include "core/digest.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "proto/arrays.h"
#include "proto/weft/v1/fabric.pb.h"
#include "proto/weft/v1/task.pb.h"

namespace weft::coordinator {

// A plain weave of four yarns with settings that make few, small shards.
inline v1::FabricDescription small_description(const std::string& name = "tiny") {
  const std::string text = R"(
    name: ")" + name + R"("
    weave {
      matrix { rows: "X." rows: ".X" }
      ends_per_cm: 20
      picks_per_cm: 20
      warp_yarn: "cotton"
      weft_yarn: "cotton"
    }
    yarns {
      name: "cotton"
      material: "white"
      fibres_per_ply: 7
      yarn_radius_mm: 0.16
      fibre_radius_mm: 0.04
    }
    materials {
      name: "white"
      c_r { r: 0.1 g: 0.1 b: 0.1 }
      c_tt { r: 0.8 g: 0.7 b: 0.6 }
      beta_r_deg: 6
      beta_tt_deg: 12
      gamma_tt_deg: 25
    }
    exemplar { segment_length_radii: 3 }
    precompute {
      sh_order: 2
      cell_length_mfp: 2
      paths_per_cell: 40000
      visibility_resolution: 32
      pca_components: 8
      pca_sample_segments: 128
    }
    seed: 1
  )";
  return fabric::parse_description(text, "small.textproto", ".");
}

inline constexpr std::uint32_t kSmallCells = 2;

// Stands for a worker's baker where only the flow of results matters: a real tile, a grid of two
// cells, and bytes that name the shard for everything else.
inline std::string fake_result(const v1::TaskSpec& spec, std::uint64_t shard) {
  v1::Arrays arrays;
  if (spec.has_geometry()) {
    return fabric::encode_tile(fabric::build_tile(spec.geometry().description()));
  }
  if (spec.has_grid()) {
    const std::array<std::uint32_t, std::size_t{3} * kSmallCells> cells{0, 0, 0, 1, 0, 0};
    v1::add_array<std::uint32_t>(arrays, "cell_coordinates", {kSmallCells, 3}, cells);
    return v1::serialize(arrays);
  }
  v1::add_text(arrays, "work", v1::canonical_bytes(spec) + "/" + std::to_string(shard));
  return v1::serialize(arrays);
}

// Blobs in memory, and every stage of a description run with fake results.
class FakeRun {
 public:
  explicit FakeRun(v1::FabricDescription description) : description_(std::move(description)) {
    for (std::vector<Stage> stages = next(); !stages.empty(); stages = next()) {
      for (Stage& stage : stages) {
        StageResults results{stage.name, {}};
        for (std::uint64_t shard = 0; shard < stage.shard_count; ++shard) {
          results.shards.push_back(put(fake_result(stage.spec, shard)));
        }
        order.push_back(stage.name);
        finished_.push_back(std::move(results));
        stages_.emplace(stage.name, std::move(stage));
      }
    }
  }

  [[nodiscard]] const Stage& stage(StageName name) const { return stages_.at(name); }
  [[nodiscard]] core::Digest digest(StageName name, std::uint64_t shard) const {
    return shard_digest(stage(name), shard, core::Digest{});
  }
  [[nodiscard]] const std::vector<StageResults>& finished() const { return finished_; }
  [[nodiscard]] std::string read(const core::Digest& digest) const { return blobs_.at(digest); }

  std::vector<StageName> order;

 private:
  std::vector<Stage> next() {
    return plan(description_, finished_, [&](const core::Digest& d) { return read(d); });
  }
  core::Digest put(const std::string& bytes) {
    const core::Digest digest = core::digest_of(bytes);
    blobs_[digest] = bytes;
    return digest;
  }

  v1::FabricDescription description_;
  std::map<core::Digest, std::string> blobs_;
  std::vector<StageResults> finished_;
  std::map<StageName, Stage> stages_;
};

}  // namespace weft::coordinator
