#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

#include "tests/cli_programs.h"

namespace weft::cli {
namespace {

class ConfigTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_.path() / "config" / "weft");
    set("WEFT_SYSTEM_CONFIG", folder_ / "system.toml");
    core::write_file_atomically(folder_ / "system.toml", "coordinator = \"127.0.0.1:2\"\n");
  }
  void TearDown() override {
    unsetenv("WEFT_COORDINATOR");  // NOLINT(concurrency-mt-unsafe)
    unsetenv("WEFT_CONFIG");       // NOLINT(concurrency-mt-unsafe)
    set("WEFT_SYSTEM_CONFIG", "");
  }

  static void set(const char* name, const std::string& value) {
    setenv(name, value.c_str(), 1);  // NOLINT(concurrency-mt-unsafe)
  }
  void write_user_file(const std::string& text) {
    core::write_file_atomically(folder_ / "config/weft/weft.toml", text);
  }
  [[nodiscard]] nlohmann::json shown(const std::string& key) {
    const Finished finished = run_weft(folder_, {"config", "show", "--json"});
    EXPECT_EQ(finished.code, 0) << finished.err;
    const nlohmann::json all = finished.json();
    for (const nlohmann::json& setting : all.at("settings")) {
      if (setting.at("key") == key) {
        return setting;
      }
    }
    return nullptr;
  }
  // The address that a command really calls.
  [[nodiscard]] std::string called() {
    const Finished finished = run_weft(folder_, {"jobs"});
    EXPECT_EQ(finished.code, 5);
    const std::size_t at = finished.err.find("answers at ");
    return at == std::string::npos ? finished.err : finished.err.substr(at + 11, 11);
  }

  TestFolder folder_;
};

TEST_F(ConfigTest, ShowTellsEveryOriginAndCommandsFollowIt) {
  EXPECT_EQ(shown("coordinator").at("origin"), "system file");
  EXPECT_EQ(shown("coordinator").at("place"), folder_ / "system.toml:1");
  EXPECT_EQ(called(), "127.0.0.1:2");
  write_user_file("# mine\ncoordinator = \"127.0.0.1:3\"\n[render]\nspp = 12\n");
  EXPECT_EQ(shown("coordinator").at("origin"), "user file");
  EXPECT_EQ(shown("spp").at("section"), "render");
  EXPECT_EQ(shown("spp").at("value"), "12");
  EXPECT_EQ(called(), "127.0.0.1:3");
  set("WEFT_COORDINATOR", "127.0.0.1:4");
  EXPECT_EQ(shown("coordinator").at("origin"), "environment");
  EXPECT_EQ(called(), "127.0.0.1:4");
  EXPECT_EQ(shown("device").at("origin"), "default");
  EXPECT_EQ(shown("device").at("value"), "auto");
}

TEST_F(ConfigTest, AMistakeInAFileIsWrongUseAndToldWithItsPlace) {
  write_user_file("colour = \"red\"\n");
  const Finished finished = run_weft(folder_, {"jobs"});
  EXPECT_EQ(finished.code, 2);
  EXPECT_NE(finished.err.find("config/weft/weft.toml:1: there is no setting"), std::string::npos)
      << finished.err;
  EXPECT_EQ(finished.out, "");
  EXPECT_EQ(run_weft(folder_, {"--help"}).code, 0);
  write_user_file("coordinator = \"nowhere\"\n");
  EXPECT_EQ(run_weft(folder_, {"jobs"}).code, 2);
  EXPECT_EQ(run_weft(folder_, {"jobs", "--coordinator", "127.0.0.1:1"}).code, 5);
}

TEST_F(ConfigTest, AnotherFileIsNamedByAVariable) {
  core::write_file_atomically(folder_ / "other.toml", "coordinator = \"127.0.0.1:5\"\n");
  set("WEFT_CONFIG", folder_ / "other.toml");
  EXPECT_EQ(called(), "127.0.0.1:5");
}

TEST_F(ConfigTest, ServicesReadTheirSections) {
  core::write_file_atomically(folder_ / "system.toml",
                              "[weft-worker]\nthreads = 0\n[weft-coordinator]\nlease = 1\n");
  for (const char* service : {"weft-worker", "weft-coordinator"}) {
    ChildProcess process({program(service), "--log-level", "error"}, folder_ / "service.err",
                         false);
    EXPECT_EQ(process.wait(20), 2) << service;
  }
  const std::string said = core::read_file(folder_ / "service.err");
  EXPECT_NE(said.find("system.toml:2: "), std::string::npos) << said;
  EXPECT_NE(said.find("system.toml:4: "), std::string::npos) << said;
}

}  // namespace
}  // namespace weft::cli
