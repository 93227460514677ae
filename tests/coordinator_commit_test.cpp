#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include "coordinator/versions/commit.h"
#include "coordinator/versions/result_folding.h"
#include "core/error.h"
#include "core/file.h"
#include "core/half.h"
#include "core/moments.h"
#include "core/random.h"
#include "fabric/tile.h"
#include "proto/arrays.h"
#include "storage/fabric_database.h"
#include "tests/coordinator_synthetic_results.h"

namespace weft::coordinator {
namespace {

using testing::HasSubstr;

using namespace test;

// A job's results as they pile up: blobs by digest, shards by index.
class Results {
 public:
  [[nodiscard]] std::string read(const core::Digest& digest) const {
    const auto found = blobs_.find(digest);
    if (found == blobs_.end()) {
      throw core::Error(core::Code::kNotFound, "no blob " + digest.hex());
    }
    return found->second;
  }
  [[nodiscard]] ReadBlob reader() const {
    return [this](const core::Digest& digest) { return read(digest); };
  }

  void put(StageName stage, std::uint64_t shard, std::uint64_t shards, const std::string& bytes) {
    const core::Digest digest = core::digest_of(bytes);
    blobs_[digest] = bytes;
    StageResults& results = of(stage);
    results.shards.resize(shards);
    results.shards[shard] = digest;
  }

  StageResults& of(StageName stage) {
    const auto found = std::find_if(stages.begin(), stages.end(),
                                    [stage](const StageResults& r) { return r.name == stage; });
    if (found != stages.end()) {
      return *found;
    }
    stages.push_back({stage, {}});
    return stages.back();
  }

  // Runs the whole job; the shards of each stage arrive in an order that `order` chooses.
  void run_job(std::uint64_t order) {
    for (std::vector<Stage> planned = plan(description(), stages, reader()); !planned.empty();
         planned = plan(description(), stages, reader())) {
      if (order % 2 == 1) {
        std::reverse(planned.begin(), planned.end());
      }
      for (const Stage& stage : planned) {
        std::vector<std::uint64_t> shards(stage.shard_count);
        std::iota(shards.begin(), shards.end(), std::uint64_t{0});
        core::Random random(order, 0);
        for (std::size_t i = shards.size(); i > 1; --i) {
          std::swap(shards[i - 1], shards[random.below(static_cast<std::uint32_t>(i))]);
        }
        for (const std::uint64_t shard : shards) {
          put(stage.name, shard, stage.shard_count, v1::serialize(result_of(stage, shard)));
        }
      }
    }
    if (order % 2 == 1) {
      std::reverse(stages.begin(), stages.end());
    }
  }

  std::vector<StageResults> stages;

 private:
  std::map<core::Digest, std::string> blobs_;
};

class CommitTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // The message with which a job is refused whose shard has been replaced by `bytes`.
  std::string refusal(StageName stage, std::uint64_t shard, const std::string& bytes) const {
    Results results;
    results.run_job(0);
    results.put(stage, shard, results.of(stage).shards.size(), bytes);
    return refusal(results);
  }
  std::string refusal(StageName stage, std::uint64_t shard, const v1::Arrays& arrays) const {
    return refusal(stage, shard, v1::serialize(arrays));
  }
  std::string refusal(const Results& results) const {
    try {
      commit(description(), results.stages, results.reader(), path_);
    } catch (const core::Error& error) {
      EXPECT_FALSE(std::filesystem::exists(path_));
      return error.what();
    }
    ADD_FAILURE() << "no error";
    return "";
  }

  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("weft_commit_") + testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::path path_ = folder_ / "fabric.h5";
};

TEST_F(CommitTest, Merge_IsIndependentOfArrivalOrder) {
  Results first;
  first.run_job(0);
  const core::Digest digest = commit(description(), first.stages, first.reader(), path_);
  const std::string bytes = core::read_file(path_);
  for (std::uint64_t order = 1; order <= 4; ++order) {
    Results other;
    other.run_job(order);
    EXPECT_EQ(commit(description(), other.stages, other.reader(), path_), digest) << order;
    EXPECT_EQ(core::read_file(path_), bytes) << order;
  }
}

TEST_F(CommitTest, Merge_PutsEverySegmentInItsPlace) {
  Results results;
  results.run_job(3);
  commit(description(), results.stages, results.reader(), path_);
  const storage::FabricDatabase db = storage::read_database(path_);
  ASSERT_EQ(db.cell_of_segment.size(), 150U);
  for (std::uint64_t segment = 0; segment < 150; ++segment) {
    for (std::uint64_t i = 0; i < kComponents; ++i) {
      EXPECT_EQ(db.ssdf[segment * kComponents + i], half_at(segment, i));
    }
    for (std::uint64_t i = 0; i < kSgCount; ++i) {
      EXPECT_EQ(db.ssg[segment * kSgCount + i], half_at(segment, i + 10));
    }
    EXPECT_EQ(db.ssg_rotation[segment], segment * 400);
    EXPECT_EQ(core::float_from_half(db.open_share[segment]), static_cast<float>(segment) / 256.0F);
  }
  EXPECT_EQ(db.ssdf_mean, ramp(64, 0.01F));
  EXPECT_EQ(db.points_mm.size(), 3U * 152);
  EXPECT_EQ(db.strands, (std::vector<std::uint32_t>{101, 0, 0, 51, 0, 0}));
}

TEST_F(CommitTest, Merge_TakesTheSignErrorFromHeldOutShards) {
  Results results;
  results.run_job(0);
  commit(description(), results.stages, results.reader(), path_);
  const std::vector<std::uint64_t> sampled = basis_sample(description(), 3);
  ASSERT_EQ(sampled.size(), 1U);
  const double wrong = 1 + 2 + 3 - (1 + static_cast<double>(sampled[0]));
  EXPECT_DOUBLE_EQ(storage::read_database(path_).ssdf_sign_error, wrong / 200);
}

TEST_F(CommitTest, Merge_GivesMeanAndStandardErrorOfAllPaths) {
  Results results;
  results.run_job(0);
  commit(description(), results.stages, results.reader(), path_);
  const storage::FabricDatabase db = storage::read_database(path_);
  EXPECT_EQ(db.cell_paths, (std::vector<std::uint64_t>{kPathsPerCell, kPathsPerCell}));
  const std::uint64_t matrix = 3 * kEntries * kEntries;
  for (std::uint64_t cell = 0; cell < kCells; ++cell) {
    for (std::uint64_t i = 0; i < matrix; i += 7) {
      double sum = 0;
      double squares = 0;
      // Blocks of 16,384 paths; one path in a hundred of each contributes.
      for (std::uint64_t path = 0; path < kPathsPerCell; ++path) {
        if (path % 16'384 % 100 == 0) {
          const double x = sample(cell, path, i);
          sum += x;
          squares += x * x;
        }
      }
      const double mean = sum / kPathsPerCell;
      const double variance = (squares - sum * mean) / (kPathsPerCell - 1);
      const double error = std::sqrt(variance / kPathsPerCell);
      EXPECT_NEAR(db.transfer[cell * matrix + i], mean, 5e-4 * mean) << i;
      EXPECT_NEAR(db.transfer_se[cell * matrix + i], error, 5e-4 * error) << i;
    }
  }
}

TEST_F(CommitTest, Merge_GivesTheSameSumsHoweverACellIsCut) {
  const auto folded = [](std::uint32_t paths_per_shard) {
    Results results;
    storage::FabricDatabase db;
    db.cell_coordinates = {0, 0, 0, 1, 0, 0};
    FinishedStage transfer;
    transfer.stage.name = StageName::kTransfer;
    v1::TransferSpec& spec = *transfer.stage.spec.mutable_transfer();
    spec.set_sh_order(kOrder);
    spec.set_paths_per_cell(10'000);
    spec.set_paths_per_shard(paths_per_shard);
    const std::uint64_t blocks = 10'000 / paths_per_shard;
    for (std::uint64_t shard = 0; shard < kCells * blocks; ++shard) {
      results.put(StageName::kTransfer, shard, kCells * blocks,
                  v1::serialize(transfer_result(shard / blocks, shard % blocks * paths_per_shard,
                                                paths_per_shard)));
    }
    transfer.shards = results.of(StageName::kTransfer).shards;
    storage::Recolouring recolouring;
    fold_transfer(transfer, results.reader(), db, recolouring);
    return db;
  };
  const storage::FabricDatabase whole = folded(10'000);
  for (const std::uint32_t paths_per_shard : {100U, 1000U, 5000U}) {
    const storage::FabricDatabase cut = folded(paths_per_shard);
    EXPECT_EQ(cut.transfer, whole.transfer) << paths_per_shard;
    EXPECT_EQ(cut.transfer_se, whole.transfer_se) << paths_per_shard;
  }
}

// Both cells of a stage with a target standard error, the second one of `paths` paths.
storage::FabricDatabase folded_to_error(double target, std::uint64_t paths) {
  Results results;
  results.put(StageName::kTransfer, 0, kCells, v1::serialize(transfer_result(0, 0, 10'000)));
  results.put(StageName::kTransfer, 1, kCells, v1::serialize(transfer_result(1, 0, paths)));
  FinishedStage transfer{{}, results.of(StageName::kTransfer).shards};
  transfer.stage.name = StageName::kTransfer;
  v1::TransferSpec& spec = *transfer.stage.spec.mutable_transfer();
  spec.set_sh_order(kOrder);
  spec.set_paths_per_cell(10'000);
  spec.set_paths_per_shard(10'000);
  spec.set_target_standard_error(target);
  storage::FabricDatabase db;
  db.cell_coordinates = {0, 0, 0, 1, 0, 0};
  storage::Recolouring recolouring;
  fold_transfer(transfer, results.reader(), db, recolouring);
  return db;
}

TEST_F(CommitTest, CellsMayEndWhereTheTargetStandardErrorLetsThemAndNowhereElse) {
  const storage::FabricDatabase db = folded_to_error(0.5, 6144);
  EXPECT_EQ(db.cell_paths, (std::vector<std::uint64_t>{10'000, 6144}));
  double squares = 0;
  for (std::size_t i = db.transfer_se.size() / 2; i < db.transfer_se.size(); ++i) {
    squares += std::pow(static_cast<double>(db.transfer_se[i]), 2);
  }
  const double error = std::sqrt(2 * squares / static_cast<double>(db.transfer_se.size()));
  EXPECT_NO_THROW(folded_to_error(1.0001 * error, 6144));
  const auto refusal_of = [](double target, std::uint64_t paths) -> std::string {
    try {
      folded_to_error(target, paths);
    } catch (const core::Error& refused) {
      EXPECT_EQ(refused.code(), core::Code::kDataLoss);
      return refused.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal_of(0.9999 * error, 6144),
              testing::AllOf(HasSubstr("stage transfer, shard 1"), HasSubstr("paths end")));
  for (const std::uint64_t paths : {768, 6100, 9999}) {
    EXPECT_THAT(refusal_of(0.5, paths), HasSubstr("stage transfer, shard 1")) << paths;
  }
  // Without a target a cell has the planned paths.
  EXPECT_THAT(refusal_of(0, 6144), HasSubstr("6144 paths together where 10000 were planned"));
}

TEST_F(CommitTest, FileSaysWhatItWasMadeFrom) {
  Results results;
  results.run_job(0);
  commit(description(), results.stages, results.reader(), path_);
  const storage::FabricDatabase db = storage::read_database(path_);
  v1::FabricDescription read;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(db.description_json, &read).ok());
  EXPECT_EQ(v1::canonical_bytes(read), v1::canonical_bytes(description()));
  EXPECT_THAT(db.stages_json, HasSubstr(std::to_string(rotation_seed(description()))));
  EXPECT_THAT(db.stages_json, HasSubstr("\"results_sha256\""));
  EXPECT_EQ(db.materials[0].c_r.y, 0.25F);
  EXPECT_NEAR(db.materials[0].beta_tt, 0.34906585, 1e-6);
  // 24 bins of a 16th of the mean free path.
  EXPECT_NEAR(db.sigma_shadow_mm, 24.0 / 16 * 0.125, 1e-5);
  EXPECT_THAT(db.stages_json, HasSubstr("\"fit_error\""));
}

TEST_F(CommitTest, MalformedResultsAreRefusedNamingStageAndShard) {
  EXPECT_THAT(refusal(StageName::kTransfer, 4, std::string("not an envelope")),
              HasSubstr("stage transfer, shard 4"));
  EXPECT_THAT(refusal(StageName::kGeometry, 0, std::string("x")),
              HasSubstr("stage geometry, shard 0"));
  EXPECT_THAT(refusal(StageName::kGrid, 0, v1::Arrays()), HasSubstr("stage grid, shard 0"));
  EXPECT_THAT(refusal(StageName::kCoefficients, 2, v1::Arrays()),
              testing::AllOf(HasSubstr("stage coefficients, shard 2"), HasSubstr("missing")));
  EXPECT_THAT(refusal(StageName::kCoefficients, 2, coefficients_result(0, 2)),
              testing::AllOf(HasSubstr("stage coefficients, shard 2"), HasSubstr("has shape")));
  EXPECT_THAT(refusal(StageName::kShadow, 1, v1::Arrays()), HasSubstr("stage shadow, shard 1"));
  EXPECT_THAT(refusal(StageName::kBasis, 0, grid_result()), HasSubstr("stage basis, shard 0"));

  v1::Arrays wrong = coefficients_result(1, 3);
  (*wrong.mutable_arrays(0)->mutable_data())[1] = 0x7c;  // an infinite half
  EXPECT_THAT(refusal(StageName::kCoefficients, 1, wrong),
              testing::AllOf(HasSubstr("stage coefficients, shard 1"), HasSubstr("not finite")));
  wrong = coefficients_result(1, 3);
  (*wrong.mutable_arrays(3)->mutable_data())[2] = 1;  // a rotation of 65536
  EXPECT_THAT(refusal(StageName::kCoefficients, 1, wrong), HasSubstr("more than a turn"));
  wrong = transfer_result(0, 0, 100);
  EXPECT_THAT(refusal(StageName::kTransfer, 1, wrong),
              testing::AllOf(HasSubstr("stage transfer, shards 0 to 2"), HasSubstr("paths")));
  wrong = transfer_result(0, 0, 16'384);
  (*wrong.mutable_arrays(2)->mutable_data())[7] = static_cast<char>(0x80);  // a negative sum
  EXPECT_THAT(refusal(StageName::kTransfer, 1, wrong),
              testing::AllOf(HasSubstr("stage transfer, shard 1"), HasSubstr("negative")));
}

TEST_F(CommitTest, UnfinishedJobsAreRefused) {
  Results results;
  results.run_job(0);
  results.of(StageName::kTransfer).shards.pop_back();
  EXPECT_THAT(refusal(results), HasSubstr("stage transfer has 5 results where 6 were planned"));
  std::erase_if(results.stages,
                [](const StageResults& r) { return r.name == StageName::kTransfer; });
  EXPECT_THAT(refusal(results), HasSubstr("stage transfer has no results yet"));
}

}  // namespace
}  // namespace weft::coordinator
