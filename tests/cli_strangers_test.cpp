#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/digest.h"
#include "storage/fabric_database.h"
#include "storage/user_block.h"
#include "tests/cli_programs.h"
#include "tests/storage_test_database.h"

// Databases that came some other way than from a coordinator, through the real command.

namespace weft::cli {
namespace {

using testing::HasSubstr;

class Strangers : public testing::Test {
 protected:
  void SetUp() override { storage::write_database(storage::small_database(), database_); }

  // The database with a terminal's codes for a fabric's name, and a description nested so deep that
  // writing it out again would end the stack, under a right digest.
  void write_nasty() {
    storage::FabricDatabase nasty = storage::small_database();
    nasty.description_json = "{\"name\": \"silk\\u001b]0;owned\\u0007\"}";
    nasty.stages_json = std::string(200'000, '[') + std::string(200'000, ']');
    storage::write_database(nasty, database_);
  }

  TestFolder folder_;
  std::string database_ = folder_ / "stranger.h5";
};

TEST_F(Strangers, ImportTakesAWholeDatabaseUnderItsNewName) {
  const std::string output = folder_ / "mine.h5";
  const Finished imported =
      run_weft(folder_, {"fetch", "--import", database_, "-o", output, "--json"});
  ASSERT_EQ(imported.code, 0) << imported.err;
  EXPECT_EQ(imported.json().at("content_digest"), storage::content_digest(database_).hex());
  EXPECT_EQ(core::read_file(output), core::read_file(database_));
}

TEST_F(Strangers, ImportLeavesNothingOfADamagedDatabase) {
  std::string bytes = core::read_file(database_);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  std::ofstream(database_, std::ios::binary) << bytes;
  const std::string output = folder_ / "mine.h5";
  const Finished imported = run_weft(folder_, {"fetch", "--import", database_, "-o", output});
  EXPECT_EQ(imported.code, 1);
  EXPECT_THAT(imported.err, HasSubstr(database_ + " is damaged"));
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    EXPECT_EQ(entry.path().string().find("mine.h5"), std::string::npos) << entry.path();
  }
}

TEST_F(Strangers, ImportOrAVersionButNotBothNorNeither) {
  EXPECT_EQ(run_weft(folder_, {"fetch"}).code, 2);
  EXPECT_EQ(run_weft(folder_, {"fetch", "silk", "--import", database_}).code, 2);
}

TEST_F(Strangers, InspectShowsWhatIsNastyWithoutHarm) {
  write_nasty();
  const Finished plain = run_weft(folder_, {"inspect", database_});
  ASSERT_EQ(plain.code, 0) << plain.err;
  EXPECT_EQ(plain.out.find('\x1b'), std::string::npos);
  EXPECT_THAT(plain.out, HasSubstr("silk?]0;owned?"));
  EXPECT_EQ(run_weft(folder_, {"inspect", database_, "--json"}).code, 0);
}

TEST_F(Strangers, NothingIsReadWithoutTheProgramThatReads) {
  const std::filesystem::path elsewhere = folder_.path() / "bin";
  std::filesystem::create_directory(elsewhere);
  std::filesystem::copy(program("weft"), elsewhere / "weft");
  const std::string log = folder_ / "log";
  const std::vector<std::string> command{(elsewhere / "weft").string(), "verify", database_};
  ChildProcess child(command, log, false);
  EXPECT_EQ(child.wait(60), 5);
  EXPECT_THAT(core::read_file(log), HasSubstr("weft-open"));
  std::filesystem::copy(program("weft-open"), elsewhere / "weft-open");
  ChildProcess again(command, log, false);
  EXPECT_EQ(again.wait(60), 0);
}

}  // namespace
}  // namespace weft::cli
