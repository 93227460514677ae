#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "core/error.h"
#include "core/exit_code.h"
#include "core/file.h"
#include "storage/fabric_database.h"
#include "tests/storage_test_database.h"

namespace weft::cli {
namespace {

using testing::HasSubstr;

class InspectTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    digest_ = storage::write_database(storage::small_database(), path_).hex();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void damage() const {
    std::string bytes = core::read_file(path_);
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 4);
    core::write_file_atomically(path_, bytes);
  }

  // Runs `weft <arguments>`; stdout goes to output_, the error that main would print to error_.
  int run(const std::string& arguments) {
    CLI::App app;
    add_inspect(app);
    add_verify(app);
    error_.clear();
    int code = 0;
    testing::internal::CaptureStdout();
    try {
      app.parse(arguments);
    } catch (const CLI::ParseError&) {
      code = core::kExitWrongUse;
    } catch (const core::Error& error) {
      error_ = error.what();
      code = exit_code(error.code());
    }
    output_ = testing::internal::GetCapturedStdout();
    return code;
  }

  std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) /
                                  (std::string("weft_inspect_") +
                                   testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::path path_ = folder_ / "small.h5";
  std::string digest_;
  std::string output_;
  std::string error_;
};

TEST_F(InspectTest, InspectPrintsOneJsonValueWithTheDigest) {
  ASSERT_EQ(run("inspect --json " + path_.string()), 0) << error_;
  const nlohmann::json json = nlohmann::json::parse(output_);
  EXPECT_EQ(json["content_digest"], digest_);
  EXPECT_EQ(json["name"], "small");
  EXPECT_EQ(json["fibres"], 3);
  EXPECT_EQ(json["segments"], 7);
  EXPECT_EQ(json["cells"], 3);
  EXPECT_EQ(json["sh_order"], 1);
  EXPECT_EQ(json["paths_per_cell"]["fewest"], 60);
  EXPECT_EQ(json["description"]["name"], "small");
  EXPECT_EQ(json["bytes"], std::filesystem::file_size(path_));
  EXPECT_GT(json["transfer_standard_error_rms"], 0);
  EXPECT_EQ(json["datasets"].size() > 30, true);
}

TEST_F(InspectTest, InspectTellsPeopleWhatIsInTheFile) {
  ASSERT_EQ(run("inspect " + path_.string()), 0) << error_;
  EXPECT_THAT(output_, HasSubstr(digest_));
  EXPECT_THAT(output_, HasSubstr("3, in 7 segments and 2 threads"));
  EXPECT_THAT(output_, HasSubstr("60 to 100 paths per cell"));
  EXPECT_THAT(output_, HasSubstr("/visibility/ssg"));
}

TEST_F(InspectTest, VerifyPassesAWholeFile) {
  ASSERT_EQ(run("verify " + path_.string()), 0) << error_;
  EXPECT_THAT(output_, HasSubstr("is whole"));
  ASSERT_EQ(run("verify --json " + path_.string()), 0) << error_;
  const nlohmann::json json = nlohmann::json::parse(output_);
  EXPECT_EQ(json["valid"], true);
  EXPECT_EQ(json["content_digest"], digest_);
}

TEST_F(InspectTest, DamageIsReportedAndFails) {
  damage();
  EXPECT_EQ(run("verify " + path_.string()), core::kExitFailed);
  EXPECT_THAT(error_, HasSubstr("small.h5 is damaged"));
  EXPECT_EQ(output_, "");
  EXPECT_EQ(run("verify --json " + path_.string()), core::kExitFailed);
  EXPECT_EQ(nlohmann::json::parse(output_)["valid"], false);
  EXPECT_EQ(run("inspect --json " + path_.string()), core::kExitFailed);
  EXPECT_THAT(error_, HasSubstr("small.h5 is damaged"));
}

TEST_F(InspectTest, MissingFileHasItsOwnExitCode) {
  for (const char* command : {"verify ", "inspect ", "verify --json ", "inspect --json "}) {
    EXPECT_EQ(run(command + (folder_ / "absent.h5").string()), core::kExitNotFound);
    EXPECT_THAT(error_, HasSubstr("absent.h5"));
    EXPECT_EQ(output_, "");
  }
  EXPECT_EQ(run("verify"), core::kExitWrongUse);
}

}  // namespace
}  // namespace weft::cli
