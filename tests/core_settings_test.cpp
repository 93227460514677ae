#include <cstdlib>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "core/settings.h"

namespace weft::core {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Two files of a folder of its own that are the user's and the machine's, and a small program.
class SettingsTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "weft-settings-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    setenv(kUserFileVariable, user().c_str(), 1);      // NOLINT(concurrency-mt-unsafe)
    setenv(kSystemFileVariable, system().c_str(), 1);  // NOLINT(concurrency-mt-unsafe)
    unsetenv("WEFT_COORDINATOR");                      // NOLINT(concurrency-mt-unsafe)
    app_.name("weft");
    CLI::App* draw = app_.add_subcommand("draw");
    draw->add_option("--coordinator", coordinator_)->envname("WEFT_COORDINATOR");
    draw->add_option("--size", size_)->check(CLI::Range(1, 100));
    draw->add_option("--label", labels_);
    CLI::Option* node = draw->add_option("--node", node_);
    draw->add_flag("--local", is_local_)->excludes(node);
  }
  void TearDown() override {
    unsetenv("WEFT_COORDINATOR");  // NOLINT(concurrency-mt-unsafe)
    std::filesystem::remove_all(folder_);
  }

  [[nodiscard]] std::string user() const { return (folder_ / "user.toml").string(); }
  [[nodiscard]] std::string system() const { return (folder_ / "system.toml").string(); }

  // Parses a command line as a program does.
  void parse(const std::string& line) {
    EnvironmentNames names(app_);
    app_.parse_complete_callback([&] {
      names.restore();
      Settings::load().apply(app_);
    });
    app_.parse(line);
  }

  std::string mistake_in(const std::string& line) {
    try {
      parse(line);
    } catch (const CLI::ConfigError& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_;
  CLI::App app_;
  std::string coordinator_ = "default:1";
  int size_ = 0;
  std::vector<std::string> labels_;
  std::string node_;
  bool is_local_ = false;
};

TEST_F(SettingsTest, CommandLineGoesBeforeEnvironmentBeforeUserFileBeforeSystemFileBeforeDefault) {
  parse("draw");
  EXPECT_EQ(coordinator_, "default:1");
  write_file_atomically(system(), "coordinator = \"system:1\"\n[draw]\nsize = 7\n");
  parse("draw");
  EXPECT_EQ(coordinator_, "system:1");
  EXPECT_EQ(size_, 7);
  write_file_atomically(user(), "coordinator = \"user:1\"\n");
  parse("draw");
  EXPECT_EQ(coordinator_, "user:1");
  EXPECT_EQ(size_, 7);
  setenv("WEFT_COORDINATOR", "environment:1", 1);  // NOLINT(concurrency-mt-unsafe)
  parse("draw");
  EXPECT_EQ(coordinator_, "environment:1");
  parse("draw --coordinator line:1 --size 8");
  EXPECT_EQ(coordinator_, "line:1");
  EXPECT_EQ(size_, 8);
}

TEST_F(SettingsTest, ACommandsSectionGoesBeforeWhatAllShareAndListsAreLists) {
  write_file_atomically(user(),
                        "coordinator = \"all:1\"\n[draw]\ncoordinator = \"draw:1\"\n"
                        "label = [\"gpu\", \"room=1\"]\nlocal = true\n");
  parse("draw");
  EXPECT_EQ(coordinator_, "draw:1");
  EXPECT_THAT(labels_, ElementsAre("gpu", "room=1"));
  EXPECT_TRUE(is_local_);
}

TEST_F(SettingsTest, WhatTheCommandLineExcludesIsLeftAlone) {
  write_file_atomically(user(), "node = \"node:1\"\n");
  parse("draw --local");
  EXPECT_EQ(node_, "");
  parse("draw");
  EXPECT_EQ(node_, "node:1");
}

TEST_F(SettingsTest, MistakesAreToldWithTheirPlace) {
  write_file_atomically(user(), "\n\ncoordinater = \"hub:1\"\n");
  EXPECT_THAT(mistake_in("draw"), HasSubstr(user() + ":3: there is no setting \"coordinater\""));
  EXPECT_THAT(mistake_in("draw"), HasSubstr("did you mean \"coordinator\"?"));
  write_file_atomically(user(), "[draw]\nsise = 3\n");
  EXPECT_THAT(mistake_in("draw"), HasSubstr(user() + ":2: draw has no setting \"sise\""));
  write_file_atomically(user(), "[drow]\nsize = 3\n");
  EXPECT_THAT(mistake_in("draw"), HasSubstr(user() + ":2: [drow] is no command"));
  write_file_atomically(user(), "[draw]\nsize = 300\n");
  EXPECT_THAT(mistake_in("draw"), HasSubstr(user() + ":2: "));
  write_file_atomically(user(), "[draw]\nsize = \n");
  EXPECT_THAT(mistake_in("draw"), HasSubstr(user() + ":2:"));
  write_file_atomically(user(), "[draw]\nsize = 1979-05-27\n");
  EXPECT_THAT(mistake_in("draw"), HasSubstr(user() + ":2: size: a value is a text"));
}

TEST_F(SettingsTest, AWrongVariableIsNamedAndOnlyToThoseWhoReadIt) {
  app_.get_subcommand("draw")->get_option("--coordinator")->check([](const std::string& address) {
    return address.find(':') == std::string::npos ? "no host:port" : "";
  });
  app_.add_subcommand("other");
  setenv("WEFT_COORDINATOR", "nowhere", 1);  // NOLINT(concurrency-mt-unsafe)
  EXPECT_THAT(mistake_in("draw"), HasSubstr("WEFT_COORDINATOR: "));
  EXPECT_EQ(mistake_in("other"), "");
}

TEST_F(SettingsTest, AServiceReadsItsOwnSectionAndLeavesOthersToTheirPrograms) {
  write_file_atomically(system(),
                        "coordinator = \"hub:1\"\n[weft-worker]\nthreads = 5\n[render]\nfoo = 1\n");
  CLI::App worker;
  worker.name("weft-worker");
  unsigned threads = 1;
  std::string coordinator;
  worker.add_option("--threads", threads);
  worker.add_option("--coordinator", coordinator);
  worker.parse("");
  Settings::load().apply(worker);
  EXPECT_EQ(threads, 5U);
  EXPECT_EQ(coordinator, "hub:1");
}

TEST_F(SettingsTest, AnOriginIsKnownForEveryValue) {
  write_file_atomically(user(), "quality = \"best\"\n");
  const auto found = Settings::load().find("submit", "quality", "");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->origin, Origin::kUserFile);
  EXPECT_EQ(found->place, user() + ":1");
  EXPECT_FALSE(Settings::load().find("submit", "user", "").has_value());
}

}  // namespace
}  // namespace weft::core
