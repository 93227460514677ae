#include <filesystem>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "storage/database_schema.h"
#include "storage/database_summary.h"
#include "storage/fabric_database.h"
#include "storage/user_block.h"
#include "tests/storage_test_database.h"

namespace weft::storage {
namespace {

using testing::HasSubstr;

class FabricDatabaseTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // The message of the kDataLoss that writing `db` throws.
  std::string refusal_of(const FabricDatabase& db) const {
    try {
      write_database(db, path_);
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kDataLoss) << error.what();
      EXPECT_FALSE(std::filesystem::exists(path_));
      return error.what();
    }
    ADD_FAILURE() << "no error";
    return "";
  }

  std::string element_of_transfer() const {
    for (const StoredDataset& dataset : stored_datasets(path_)) {
      if (dataset.path == "/iirtf/transfer") {
        return dataset.element;
      }
    }
    return "";
  }

  std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) /
                                  (std::string("weft_database_") +
                                   testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::path path_ = folder_ / "small.h5";
};

TEST_F(FabricDatabaseTest, ReadsBackWhatWasWritten) {
  const FabricDatabase db = small_database();
  write_database(db, path_);
  const FabricDatabase read = read_database(path_);
  EXPECT_EQ(read.size_mm, db.size_mm);
  EXPECT_EQ(read.z_bounds_mm, db.z_bounds_mm);
  EXPECT_EQ(read.blocks, db.blocks);
  EXPECT_EQ(read.material_names, db.material_names);
  EXPECT_EQ(read.yarn_names, db.yarn_names);
  EXPECT_EQ(read.threads, db.threads);
  EXPECT_EQ(read.strands, db.strands);
  EXPECT_EQ(read.strand_periods, db.strand_periods);
  EXPECT_EQ(read.strand_radius_mm, db.strand_radius_mm);
  EXPECT_EQ(read.points_mm, db.points_mm);
  EXPECT_EQ(read.materials, db.materials);
  EXPECT_EQ(read.c_s, db.c_s);
  EXPECT_EQ(read.mean_free_path_mm, db.mean_free_path_mm);
  EXPECT_EQ(read.sigma_shadow_mm, db.sigma_shadow_mm);
  EXPECT_EQ(read.cells_per_axis, db.cells_per_axis);
  EXPECT_EQ(read.cell_of_segment, db.cell_of_segment);
  EXPECT_EQ(read.cell_coordinates, db.cell_coordinates);
  EXPECT_EQ(read.sh_order, db.sh_order);
  EXPECT_EQ(read.cell_paths, db.cell_paths);
  EXPECT_EQ(read.transfer, db.transfer);
  EXPECT_EQ(read.transfer_se, db.transfer_se);
  EXPECT_EQ(read.visibility_resolution, db.visibility_resolution);
  EXPECT_EQ(read.pca_components, db.pca_components);
  EXPECT_EQ(read.ssdf_mean, db.ssdf_mean);
  EXPECT_EQ(read.ssdf_basis, db.ssdf_basis);
  EXPECT_EQ(read.ssdf, db.ssdf);
  EXPECT_EQ(read.sg_count, db.sg_count);
  EXPECT_EQ(read.sg_sharpness, db.sg_sharpness);
  EXPECT_EQ(read.ssg, db.ssg);
  EXPECT_EQ(read.ssg_rotation, db.ssg_rotation);
  EXPECT_EQ(read.open_share, db.open_share);
  EXPECT_EQ(read.ssdf_sign_error, db.ssdf_sign_error);
  EXPECT_EQ(read.description_json, db.description_json);
  EXPECT_EQ(read.stages_json, db.stages_json);
  EXPECT_EQ(read.software, db.software);
}

TEST_F(FabricDatabaseTest, EqualContentsGiveEqualFiles) {
  const core::Digest first = write_database(small_database(), path_);
  // Other writes in between move the library's memory about.
  FabricDatabase other = small_database();
  other.description_json.assign(100'000, 'x');
  const core::Digest different = write_database(other, folder_ / "other.h5");
  const core::Digest second = write_database(small_database(), folder_ / "second.h5");
  EXPECT_EQ(first, second);
  EXPECT_NE(first, different);
  EXPECT_EQ(core::read_file(path_), core::read_file(folder_ / "second.h5"));
  write_database(read_database(path_), folder_ / "third.h5");
  EXPECT_EQ(core::read_file(path_), core::read_file(folder_ / "third.h5"));
}

TEST_F(FabricDatabaseTest, DigestIsThatOfEverythingAfterTheUserBlock) {
  const core::Digest digest = write_database(small_database(), path_);
  EXPECT_EQ(content_digest(path_), digest);
  EXPECT_EQ(verify_database(path_), digest);
  const std::string bytes = core::read_file(path_);
  EXPECT_EQ(core::digest_of(std::string_view(bytes).substr(kUserBlockBytes)), digest);
  EXPECT_EQ(bytes.substr(0, 4), "weft");
  EXPECT_EQ(std::filesystem::file_size(path_), bytes.size());
}

TEST_F(FabricDatabaseTest, WritingLeavesNothingBesideTheFile) {
  write_database(small_database(), path_);
  write_database(small_database(), path_);
  FabricDatabase wrong = small_database();
  wrong.size_mm.x = -1;
  EXPECT_THROW(write_database(wrong, path_), core::Error);
  EXPECT_EQ(read_database(path_).size_mm, small_database().size_mm);
  const auto entries = std::filesystem::directory_iterator(folder_);
  EXPECT_EQ(std::distance(begin(entries), end(entries)), 1);
}

TEST_F(FabricDatabaseTest, TransferIsHalfOnlyWhereItsErrorIsLarger) {
  FabricDatabase db = small_database();
  db.transfer[5] = 0.1234567F;  // rounding 2e-5, far below the standard error 1e-2
  write_database(db, path_);
  EXPECT_EQ(element_of_transfer(), "f16");
  EXPECT_NE(read_database(path_).transfer[5], db.transfer[5]);
  EXPECT_NEAR(read_database(path_).transfer[5], db.transfer[5], 3.1e-5);
  db.transfer_se.assign(db.transfer_se.size(), 0x1p-24F);
  write_database(db, path_);
  EXPECT_EQ(read_database(path_).transfer, db.transfer);
  EXPECT_EQ(element_of_transfer(), "f32");
}

TEST_F(FabricDatabaseTest, RefusesToWriteWhatContradictsItself) {
  FabricDatabase db = small_database();
  db.ssdf.pop_back();
  EXPECT_THAT(refusal_of(db), HasSubstr("/visibility/ssdf/coefficients"));
  db = small_database();
  db.materials.clear();
  db.material_names.clear();
  EXPECT_THAT(refusal_of(db), HasSubstr("/exemplar/material_names"));
  db = small_database();
  db.material_names.pop_back();
  EXPECT_THAT(refusal_of(db), HasSubstr("/exemplar/material_names"));
  db = small_database();
  db.strands[0] = 4;
  EXPECT_THAT(refusal_of(db), HasSubstr("/exemplar/strands"));
  db = small_database();
  db.strands[1] = 2;
  EXPECT_THAT(refusal_of(db), HasSubstr("a material is missing"));
  db = small_database();
  db.cell_of_segment[3] = 3;
  EXPECT_THAT(refusal_of(db), HasSubstr("/cells/cell_of_segment"));
  db = small_database();
  db.cell_coordinates[4] = 2;
  EXPECT_THAT(refusal_of(db), HasSubstr("/cells/coordinates"));
  db = small_database();
  db.transfer[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refusal_of(db), HasSubstr("/iirtf/transfer"));
  db = small_database();
  db.ssg[7] = 0x7c00;
  EXPECT_THAT(refusal_of(db), HasSubstr("/visibility/ssg/weights"));
  db = small_database();
  db.materials[1].c_tt.y = 1.5F;
  EXPECT_THAT(refusal_of(db), HasSubstr("/materials/c_tt"));
}

TEST_F(FabricDatabaseTest, FileThatIsNotThereIsNotFound) {
  for (const auto& path : {folder_ / "absent.h5", folder_}) {
    try {
      verify_database(path);
      ADD_FAILURE() << "no error";
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kNotFound) << error.what();
      EXPECT_THAT(error.what(), HasSubstr(path.string()));
    }
  }
}

TEST_F(FabricDatabaseTest, FileOfAnotherKindIsRefused) {
  for (const std::string& bytes : {std::string(), std::string("hello\n"), std::string(4096, 'w')}) {
    core::write_file_atomically(path_, bytes);
    try {
      std::ignore = read_database(path_);
      ADD_FAILURE() << "no error";
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kDataLoss);
      EXPECT_THAT(error.what(), HasSubstr("is not a fabric database"));
    }
  }
}

TEST_F(FabricDatabaseTest, FileOfANewerSchemaAsksForANewerProgram) {
  write_database(small_database(), path_);
  std::string bytes = core::read_file(path_);
  bytes.replace(0, kUserBlockBytes,
                encode_user_block({kDatabaseSchema + 1, bytes.size(), content_digest(path_)}));
  core::write_file_atomically(path_, bytes);
  try {
    verify_database(path_);
    FAIL() << "no error";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kFailedPrecondition);
    EXPECT_THAT(error.what(), HasSubstr("use a newer weft"));
  }
}

TEST(DatabaseFormat, DocumentNamesEveryGroupAndDataset) {
  const std::string document =
      core::read_file(std::filesystem::path(WEFT_SOURCE_DIR) / "docs/database_format.md");
  for (const DatasetSpec& spec : dataset_specs()) {
    const std::string path = spec.path;
    const std::size_t slash = path.find('/', 1);
    EXPECT_THAT(document, HasSubstr("\n## " + path.substr(0, slash) + ":")) << path;
    EXPECT_THAT(document, HasSubstr('`' + path.substr(slash + 1) + '`')) << path;
  }
}

}  // namespace
}  // namespace weft::storage
