#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "coordinator/plan.h"
#include "core/error.h"
#include "fabric/tile.h"
#include "tests/coordinator_fabric.h"

namespace weft::coordinator {
namespace {

std::uint64_t segments_of(const FakeRun& run) {
  return fabric::decode_tile(run.read(run.finished()[0].shards[0])).segment_count();
}

TEST(Plan, Job_BeginsWithItsGeometryAndEndsWithAllStages) {
  const v1::FabricDescription description = small_description();
  const auto no_blob = [](const core::Digest&) -> std::string {
    throw core::Error(core::Code::kNotFound, "no blob");
  };
  const std::vector<Stage> first = plan(description, {}, no_blob);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].name, StageName::kGeometry);
  EXPECT_EQ(first[0].shard_count, 1U);

  const FakeRun run(description);
  std::vector<StageName> order = run.order;
  std::sort(order.begin(), order.end());
  EXPECT_EQ(order, all_stages());
}

TEST(Plan, Stages_HaveTheShardsThatTheirIndexSpaceNeeds) {
  const FakeRun run(small_description());
  const std::uint64_t segments = segments_of(run);
  const std::uint64_t visibility = (segments + 63) / 64;
  EXPECT_GT(visibility, 3U);
  EXPECT_EQ(run.stage(StageName::kVisibility).shard_count, visibility);
  EXPECT_EQ(run.stage(StageName::kCoefficients).shard_count, visibility);
  EXPECT_EQ(run.stage(StageName::kCoefficients).shard_inputs.size(), visibility);
  EXPECT_EQ(run.stage(StageName::kBasis).inputs.size(), 2U);  // 128 segments are two shards
  // 40,000 paths are three blocks of 16,384 for each cell.
  EXPECT_EQ(run.stage(StageName::kTransfer).shard_count, kSmallCells * 3U);
  EXPECT_EQ(run.stage(StageName::kTransfer).inputs.size(), 2U);
}

TEST(Plan, ShardDigests_AreAllDifferent) {
  const FakeRun run(small_description());
  std::set<core::Digest> digests;
  std::size_t count = 0;
  for (const StageName name : all_stages()) {
    for (std::uint64_t shard = 0; shard < run.stage(name).shard_count; ++shard) {
      digests.insert(run.digest(name, shard));
      ++count;
    }
  }
  EXPECT_EQ(digests.size(), count);
}

TEST(Plan, Fingerprint_EntersTheDigest) {
  const FakeRun run(small_description());
  const Stage& stage = run.stage(StageName::kVisibility);
  EXPECT_NE(shard_digest(stage, 0, core::digest_of("a")),
            shard_digest(stage, 0, core::digest_of("b")));
}

TEST(Plan, AnotherColour_RedoesTheTransferOnly) {
  v1::FabricDescription changed = small_description();
  changed.mutable_materials(0)->mutable_c_tt()->set_r(0.2);
  const FakeRun before(small_description());
  const FakeRun after(changed);
  for (const StageName name : all_stages()) {
    EXPECT_EQ(before.digest(name, 0) == after.digest(name, 0),
              name != StageName::kTransfer && name != StageName::kShadow)
        << to_string(name);
  }
}

TEST(Plan, NameAndComment_ChangeNoWork) {
  v1::FabricDescription changed = small_description("another");
  changed.set_comment("another comment");
  const FakeRun before(small_description());
  const FakeRun after(changed);
  for (const StageName name : all_stages()) {
    EXPECT_EQ(before.digest(name, 0), after.digest(name, 0)) << to_string(name);
  }
}

TEST(Plan, RaisedPathsPerCell_KeepTheFullBlocks) {
  v1::FabricDescription more = small_description();
  more.mutable_precompute()->set_paths_per_cell(80'000);  // five blocks instead of three
  const FakeRun before(small_description());
  const FakeRun after(more);
  for (std::uint64_t cell = 0; cell < kSmallCells; ++cell) {
    for (std::uint64_t block = 0; block < 2; ++block) {
      EXPECT_EQ(before.digest(StageName::kTransfer, cell * 3 + block),
                after.digest(StageName::kTransfer, cell * 5 + block));
    }
    // The third one was cut short.
    EXPECT_NE(before.digest(StageName::kTransfer, cell * 3 + 2),
              after.digest(StageName::kTransfer, cell * 5 + 2));
  }
}

TEST(Plan, TargetStandardError_MakesACellOneShard) {
  v1::FabricDescription description = small_description();
  const FakeRun fixed(description);
  EXPECT_EQ(fixed.stage(StageName::kTransfer).spec.transfer().target_standard_error(), 0);
  description.mutable_precompute()->set_target_standard_error(0.01);
  const FakeRun run(description);
  const Stage& stage = run.stage(StageName::kTransfer);
  EXPECT_EQ(stage.shard_count, kSmallCells);
  EXPECT_EQ(stage.spec.transfer().paths_per_cell(), 40'000U);
  EXPECT_EQ(stage.spec.transfer().paths_per_shard(), 40'000U);
  EXPECT_EQ(stage.spec.transfer().target_standard_error(), 0.01);

  // Another target or another bound is other work, for the transfer only.
  v1::FabricDescription other = description;
  other.mutable_precompute()->set_target_standard_error(0.02);
  v1::FabricDescription more = description;
  more.mutable_precompute()->set_paths_per_cell(50'000);
  for (const v1::FabricDescription& changed : {other, more}) {
    const FakeRun after(changed);
    for (const StageName name : all_stages()) {
      EXPECT_EQ(run.digest(name, 0) == after.digest(name, 0), name != StageName::kTransfer)
          << to_string(name);
    }
  }
  // A cell that may stop early is not the cell of as many paths.
  v1::FabricDescription one_block = small_description();
  one_block.mutable_precompute()->set_paths_per_cell(10'000);
  v1::FabricDescription may_stop = one_block;
  may_stop.mutable_precompute()->set_target_standard_error(0.01);
  EXPECT_NE(FakeRun(one_block).digest(StageName::kTransfer, 0),
            FakeRun(may_stop).digest(StageName::kTransfer, 0));

  description.mutable_precompute()->set_paths_per_cell((1 << 20) + 1);
  EXPECT_THROW(FakeRun{description}, core::Error);
}

TEST(Plan, AnotherSeed_ChangesWhatIsDrawnAndNotTheVisibility) {
  v1::FabricDescription changed = small_description();
  changed.set_seed(2);
  const FakeRun before(small_description());
  const FakeRun after(changed);
  EXPECT_NE(before.stage(StageName::kTransfer).spec.transfer().seed(),
            after.stage(StageName::kTransfer).spec.transfer().seed());
  EXPECT_NE(rotation_seed(small_description()), rotation_seed(changed));
  EXPECT_EQ(before.stage(StageName::kVisibility).spec.SerializeAsString(),
            after.stage(StageName::kVisibility).spec.SerializeAsString());
}

TEST(Plan, BasisSample_IsSeededAscendingAndAsLargeAsAsked) {
  v1::FabricDescription description = small_description();
  description.mutable_precompute()->set_pca_sample_segments(4096);
  const std::vector<std::uint64_t> sample = basis_sample(description, 1000);
  EXPECT_EQ(sample.size(), 64U);
  EXPECT_TRUE(std::is_sorted(sample.begin(), sample.end()));
  EXPECT_EQ(std::set<std::uint64_t>(sample.begin(), sample.end()).size(), 64U);
  EXPECT_LT(sample.back(), 1000U);
  EXPECT_EQ(sample, basis_sample(description, 1000));
  description.set_seed(2);
  EXPECT_NE(sample, basis_sample(description, 1000));
  EXPECT_EQ(basis_sample(description, 10).size(), 10U);
  description.mutable_precompute()->set_pca_sample_segments(1);
  EXPECT_EQ(basis_sample(description, 10).size(), 1U);
}

TEST(Plan, DescriptionThatIsNotCanonical_IsRefused) {
  v1::FabricDescription description = small_description();
  description.mutable_precompute()->clear_visibility_resolution();
  EXPECT_THROW(FakeRun{description}, core::Error);
}

TEST(Plan, MalformedGrid_IsDataLoss) {
  const FakeRun run(small_description());
  const std::vector<StageResults> finished = {run.finished()[0],
                                              {StageName::kGrid, {core::digest_of("grid")}}};
  const auto read = [&](const core::Digest& digest) {
    return digest == core::digest_of("grid") ? std::string("no grid") : run.read(digest);
  };
  try {
    (void)plan(small_description(), finished, read);
    FAIL() << "nothing was thrown";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kDataLoss);
  }
}

TEST(Plan, MoreShardsThanTheLimit_AreRefusedByItsName) {
  v1::FabricDescription description = small_description();
  const FakeRun run(description);
  description.mutable_precompute()->set_paths_per_cell(4'000'000'000);
  constexpr std::uint32_t kCells = 100;
  v1::Arrays arrays;
  v1::add_array<std::uint32_t>(arrays, "cell_coordinates", {kCells, 3},
                               std::vector<std::uint32_t>(3 * kCells));
  const std::string grid = v1::serialize(arrays);
  const std::vector<StageResults> finished = {run.finished()[0],
                                              {StageName::kGrid, {core::digest_of(grid)}}};
  try {
    (void)plan(description, finished, [&](const core::Digest& digest) {
      return digest == core::digest_of(grid) ? grid : run.read(digest);
    });
    FAIL() << "nothing was thrown";
  } catch (const core::Error& error) {
    EXPECT_EQ(std::string(error.what()).rfind("stage_shards_limit:", 0), 0U) << error.what();
  }
}

}  // namespace
}  // namespace weft::coordinator
