#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <unistd.h>

#include "core/file.h"

namespace weft::cli {
namespace {

using ::testing::HasSubstr;

struct Outcome {
  int code = -1;
  std::string text;  // stdout and stderr
};

Outcome weft(const std::string& arguments) {
  const std::string command = std::string(WEFT_BIN_DIR) + "/weft " + arguments + " 2>&1";
  Outcome outcome;
  std::FILE* pipe = ::popen(command.c_str(), "r");
  char buffer[4096];
  while (const std::size_t n = std::fread(buffer, 1, sizeof buffer, pipe)) {
    outcome.text.append(buffer, n);
  }
  const int status = ::pclose(pipe);
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

class Drafts : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("weft_drafts_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_ / name).string();
  }

 private:
  std::filesystem::path folder_;
};

const char* const kPlain =
    "[WIF]\nVersion=1.1\n[WARP]\nThreads=2\n[WEFT]\nThreads=2\n"
    "[THREADING]\n1=1\n2=2\n[LIFTPLAN]\n1=1\n2=2\n";

TEST_F(Drafts, ANewDescriptionIsNotWrittenOverAnother) {
  EXPECT_EQ(weft("new --preset silk -o " + path("f.textproto")).code, 0);
  EXPECT_THAT(core::read_file(path("f.textproto")), HasSubstr("name: \"silk_plain\""));
  const Outcome again = weft("new --preset cotton -o " + path("f.textproto"));
  EXPECT_EQ(again.code, 1);
  EXPECT_THAT(again.text, HasSubstr("exists already; choose another file, or --force"));
  EXPECT_EQ(weft("new --preset cotton --force -o " + path("f.textproto")).code, 0);
  EXPECT_THAT(core::read_file(path("f.textproto")), HasSubstr("name: \"cotton1\""));
}

TEST_F(Drafts, PresetsAreListedAndAnUnknownOneIsRefused) {
  const nlohmann::json list = nlohmann::json::parse(weft("new --list --json").text);
  EXPECT_EQ(list["yarns"].size(), 9U);
  EXPECT_EQ(list["materials"].size(), 4U);
  const Outcome unknown = weft("new --preset slik");
  EXPECT_EQ(unknown.code, 3);
  EXPECT_THAT(unknown.text, HasSubstr("there is no preset \"slik\"; did you mean \"silk\"?"));
  EXPECT_EQ(weft("new").code, 2);
}

TEST_F(Drafts, AnImportReportsAndWritesADescription) {
  core::write_file_atomically(path("plain.wif"), kPlain);
  const Outcome outcome =
      weft("import " + path("plain.wif") + " -o " + path("f.textproto") + " --json");
  EXPECT_EQ(outcome.code, 0);
  const nlohmann::json report = nlohmann::json::parse(outcome.text);
  EXPECT_EQ(report["repeat_ends"], 2);
  EXPECT_EQ(report["too_large"], false);
  EXPECT_GT(report["segments"], 100);
  EXPECT_THAT(report["notes"], ::testing::Contains("[CONTENTS] is missing; every section that is "
                                                   "there was read"));
  EXPECT_THAT(core::read_file(path("f.textproto")), HasSubstr("rows: \"X.\""));
}

TEST_F(Drafts, ABrokenDraftOrCropIsRefusedAndWritesNothing) {
  core::write_file_atomically(path("b.wif"), "[WIF]\n[THREADING]\n1=x\n");
  const Outcome broken = weft("import " + path("b.wif") + " -o " + path("f.textproto"));
  EXPECT_EQ(broken.code, 1);
  EXPECT_THAT(broken.text, HasSubstr("b.wif:"));
  core::write_file_atomically(path("plain.wif"), kPlain);
  const std::string import = "import " + path("plain.wif") + " -o " + path("f.textproto");
  const Outcome crop = weft(import + " --crop-ends 2:5");
  EXPECT_EQ(crop.code, 1);
  EXPECT_THAT(crop.text, HasSubstr("the crop wants 5 ends from end 2 on"));
  EXPECT_THAT(weft(import + " --crop-ends banana").text, HasSubstr("is no range; write A:N"));
  EXPECT_EQ(weft(import + " --name 'A b'").code, 1);
  EXPECT_FALSE(std::filesystem::exists(path("f.textproto")));
  EXPECT_EQ(weft("import " + path("none.wif") + " -o " + path("f.textproto")).code, 3);
}

TEST_F(Drafts, OptionsOfTheOtherKindOfFileAreWrongUse) {
  core::write_file_atomically(path("plain.wif"), kPlain);
  const std::string curves = std::string(WEFT_SOURCE_DIR) + "/fuzz/corpus/bcc/yarns.bcc";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {path("plain.wif") + " --period 1,1", "--period: it is for curves (.bcc)"},
      {curves + " --period 2,2 --fibre-share 0.5", "--fibre-share: it is for drafts"},
      {curves, "--period: curves do not say where they repeat; give it as X,Y"},
      {curves + " --period 2", "--period: 2 is not two lengths; write for example 4.2,3.5"},
      {path("plain.wif") + " --crop-picks 0:2", "--crop-picks: 0:2 is no range"}};
  for (const auto& [arguments, expected] : cases) {
    const Outcome outcome = weft("import " + arguments + " -o " + path("o.textproto"));
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_THAT(outcome.text, HasSubstr(expected));
  }
  EXPECT_FALSE(std::filesystem::exists(path("o.textproto")));
  EXPECT_EQ(weft("import " + curves + " --period 2,2 --as fibres -o " + path("o.textproto")).code,
            0);
}

TEST_F(Drafts, WrongUseOfExportIsSaid) {
  const std::string export_tiny =
      "export " + std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto -o ";
  const Outcome ending = weft(export_tiny + path("fibres.xyz"));
  EXPECT_EQ(ending.code, 2);
  EXPECT_THAT(ending.text, HasSubstr("fibres.xyz' does not tell it; give pbrt, bcc, obj or usda"));
  EXPECT_EQ(weft(export_tiny + path("fibres.obj") + " --tiles 0x1").code, 2);
  EXPECT_EQ(weft(export_tiny + path("none/fibres.obj")).code, 3);
}

}  // namespace
}  // namespace weft::cli
