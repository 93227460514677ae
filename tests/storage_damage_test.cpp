#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/file.h"
#include "storage/database_schema.h"
#include "storage/fabric_database.h"
#include "storage/user_block.h"
#include "tests/storage_test_database.h"

// Under AddressSanitizer an allocation of absurd size fails as it does elsewhere: the library asks
// for one when a damaged file tells it to, and takes the refusal as an error.
extern "C" const char* __asan_default_options() { return "allocator_may_return_null=1"; }
// HDF5 forgets a few hundred bytes when it gives up on damaged metadata.
extern "C" const char* __lsan_default_suppressions() { return "leak:libhdf5"; }

namespace weft::storage {
namespace {

using testing::HasSubstr;

// Output of tests/storage_h5py.py, or nothing when python3 or h5py is missing.
std::optional<std::string> run_h5py(const std::string& arguments) {
  const std::string command =
      "/usr/bin/python3 " WEFT_SOURCE_DIR "/tests/storage_h5py.py " + arguments;
  if (std::system("/usr/bin/python3 -c 'import h5py' 2>/dev/null") != 0) {  // NOLINT
    return std::nullopt;
  }
  FILE* pipe = popen(command.c_str(), "r");
  std::string output;
  char buffer[4096];
  for (std::size_t n = fread(buffer, 1, sizeof(buffer), pipe); n > 0;
       n = fread(buffer, 1, sizeof(buffer), pipe)) {
    output.append(buffer, n);
  }
  EXPECT_EQ(pclose(pipe), 0) << command;
  return output;
}

class DamageTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    write_database(small_database(), whole_);
    bytes_ = core::read_file(whole_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // Gives damaged bytes the digest they ought to have.
  static std::string sealed(std::string bytes) {
    UserBlock block;
    block.file_bytes = bytes.size();
    block.digest = core::digest_of(std::string_view(bytes).substr(kUserBlockBytes));
    return bytes.replace(0, kUserBlockBytes, encode_user_block(block));
  }

  // What verifying a file of these bytes throws; empty when it passes.
  std::string complaint_about(const std::string& bytes) const {
    FILE* file = std::fopen(damaged_.c_str(), "wb");
    std::fwrite(bytes.data(), 1, bytes.size(), file);
    std::fclose(file);
    return complaint();
  }

  std::string complaint() const {
    try {
      verify_database(damaged_);
    } catch (const core::Error& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("weft_damage_") + testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::path whole_ = folder_ / "whole.h5";
  std::filesystem::path damaged_ = folder_ / "damaged.h5";
  std::string bytes_;
};

TEST_F(DamageTest, AnyDamagedByteOfTheUserBlockIsNoticed) {
  for (std::size_t i = 0; i < kUserBlockBytes; ++i) {
    std::string damaged = bytes_;
    damaged[i] = static_cast<char>(damaged[i] ^ (1 << i % 8));
    EXPECT_NE(complaint_about(damaged), "") << "byte " << i;
  }
}

TEST_F(DamageTest, SurplusIsNoticed) {
  EXPECT_NE(complaint_about(bytes_ + '\0'), "");
  EXPECT_EQ(complaint_about(bytes_), "");
}

// Someone who damages data inside the file and mends the digest still meets the checksum of the
// dataset.
TEST_F(DamageTest, DatasetsHaveChecksumsOfTheirOwn) {
  FabricDatabase db = small_database();
  db.size_mm = {0x1.23456p-1F, 0x1.65432p-1F};  // not compressed: found as it is
  write_database(db, whole_);
  bytes_ = core::read_file(whole_);
  const auto* const size = reinterpret_cast<const char*>(&db.size_mm.x);
  const std::size_t at = bytes_.find(std::string(size, sizeof(db.size_mm)));
  ASSERT_NE(at, std::string::npos);
  bytes_[at] = static_cast<char>(bytes_[at] ^ 1);
  EXPECT_THAT(complaint_about(sealed(bytes_)),
              testing::AllOf(HasSubstr("/exemplar/size_mm"), HasSubstr("checksum")));
}

TEST_F(DamageTest, H5pyReadsEverythingWithoutDocumentation) {
  write_database(small_database(), small_recolouring(), whole_);
  const std::optional<std::string> output = run_h5py(whole_.string());
  if (!output) {
    GTEST_SKIP() << "/usr/bin/python3 has no h5py";
  }
  const nlohmann::json read = nlohmann::json::parse(*output);
  const FabricDatabase db = small_database();
  EXPECT_EQ(read["user_block"], kUserBlockBytes);
  EXPECT_EQ(read["bare"], nlohmann::json::array()) << "without captions or checksum";
  EXPECT_EQ(read["transfer_type"], "<f2");
  EXPECT_EQ(read["transfer"].get<std::vector<float>>(), db.transfer);
  EXPECT_EQ(read["material_names"].get<std::vector<std::string>>(), db.material_names);
  EXPECT_EQ(read["description"], db.description_json);
  EXPECT_FLOAT_EQ(read["phi"][0].get<float>(), 0.39269908F);
  for (const DatasetSpec& spec : dataset_specs()) {
    EXPECT_TRUE(read["shapes"].contains(std::string(spec.path).substr(1))) << spec.path;
  }
  EXPECT_EQ(read["shapes"].size(), dataset_specs().size());
}

}  // namespace
}  // namespace weft::storage
