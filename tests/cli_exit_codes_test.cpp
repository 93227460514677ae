#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cli/application.h"
#include "core/command_doc.h"
#include "core/file.h"
#include "tests/cli_programs.h"

// What commands end with: 0 done, 1 failed, 2 wrong use, 3 not found, 4 refused, 5 unavailable.

namespace weft::cli {
namespace {

struct Use {
  int code;
  std::vector<std::string> arguments;
};

// Something other than 0 is explained on stderr, and then nothing goes to stdout.
void expect_code(const Finished& finished, const Use& use) {
  const std::string command = testing::PrintToString(use.arguments);
  EXPECT_EQ(finished.code, use.code) << command << finished.err;
  if (use.code != 0) {
    EXPECT_NE(finished.err, "") << command;
    EXPECT_EQ(finished.out, "") << command;
  }
}

void expect_refusals_of(const TestFolder& folder, const core::CommandDoc& doc,
                        std::vector<std::string> path) {
  path.push_back(doc.name);
  Use unknown{2, path};
  unknown.arguments.emplace_back("--no-such-option");
  expect_code(run_weft(folder, unknown.arguments), unknown);
  Use help{0, path};
  help.arguments.emplace_back("--help");
  expect_code(run_weft(folder, help.arguments), help);
  for (const core::CommandDoc& command : doc.commands) {
    expect_refusals_of(folder, command, path);
  }
}

TEST(ExitCodes, EveryCommandEndsWithTwoForAnUnknownOptionAndWithZeroForItsHelp) {
  const TestFolder folder;
  CLI::App app;
  build_application(app);
  for (const core::CommandDoc& command : core::describe(app).commands) {
    expect_refusals_of(folder, command, {});
  }
}

TEST(ExitCodes, WithoutACoordinator) {
  const TestFolder folder;
  const std::string tiny = std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto";
  core::write_file_atomically(folder / "damaged.h5", std::string(4096, 'x'));
  core::write_file_atomically(folder / "broken.textproto", "name: \"x\"\nwarp { }\n");
  core::write_file_atomically(folder / "broken.wif", "no draft\n");
  const std::string out = folder / "out";
  const std::vector<Use> uses{{0, {"new", "--list"}},
                              {0, {"new", "--preset", "silk"}},
                              {0, {"run", tiny, "--dry-run"}},
                              {0, {"preview", tiny, "-o", out + ".png", "--pixels", "32"}},
                              {0, {"config", "show"}},
                              {0, {"man"}},
                              {0, {"completion", "zsh"}},
                              {0, {"certs", "init", "--authority", folder / "authority"}},
                              {0, {"certs", "list", "--authority", folder / "authority"}},
                              {1, {"run", folder / "broken.textproto", "-o", out + ".h5"}},
                              {1, {"preview", folder / "broken.textproto", "-o", out + ".png"}},
                              {1, {"import", folder / "broken.wif", "-o", out + ".textproto"}},
                              {1, {"inspect", folder / "damaged.h5"}},
                              {1, {"verify", folder / "damaged.h5"}},
                              {1, {"render", folder / "damaged.h5", "-o", out + ".exr"}},
                              {2, {}},
                              {2, {"no-such-command"}},
                              {2, {"certs"}},
                              {2, {"completion", "tcsh"}},
                              {3, {"new", "--preset", "chain mail"}},
                              {3, {"run", folder / "none.textproto", "-o", out + ".h5"}},
                              {3, {"export", folder / "none.textproto", "-o", out + ".obj"}},
                              {3, {"import", folder / "none.wif", "-o", out + ".textproto"}},
                              {3, {"inspect", folder / "none.h5"}},
                              {3, {"verify", folder / "none.h5"}},
                              {3, {"compare", folder / "none.exr", folder / "none.exr"}},
                              {3, {"fetch", "--import", folder / "none.h5"}},
                              {3, {"certs", "list", "--authority", folder / "nowhere"}},
                              {3, {"man", "chain-mail"}},
                              {5, {"run", tiny, "-o", "/proc/out.h5"}}};
  for (const Use& use : uses) {
    expect_code(run_weft(folder, use.arguments), use);
  }
}

TEST(ExitCodes, WithACoordinator) {
  const TestFolder folder;
  const TestCluster cluster(folder, "codes", 0);
  const std::vector<Use> uses{{0, {"jobs"}},
                              {0, {"workers"}},
                              {0, {"fabrics"}},
                              {0, {"gc", "--dry-run"}},
                              {3, {"watch", "j1"}},
                              {3, {"explain", "job", "j1"}},
                              {3, {"explain", "worker", "w1"}},
                              {3, {"logs", "j1"}},
                              {3, {"pause", "j1"}},
                              {3, {"resume", "j1"}},
                              {3, {"priority", "j1", "3"}},
                              {3, {"cancel", "j1"}},
                              {3, {"retry", "j1"}},
                              {3, {"unblock", "w1"}},
                              {3, {"versions", "silk"}},
                              {3, {"fetch", "silk@1"}},
                              {3, {"log", "silk"}},
                              {3, {"diff", "silk@1", "silk@2"}},
                              {3, {"tag", "silk@1", "good"}},
                              {3, {"untag", "silk:good"}},
                              {3, {"rollback", "silk@1"}},
                              {3, {"render", "silk", "-o", folder / "a.exr"}}};
  for (const Use& use : uses) {
    expect_code(cluster.weft(use.arguments), use);
  }
}

TEST(ExitCodes, WhoMayNotIsRefusedWithFour) {
  const TestFolder folder;
  const std::string authority = folder / "authority";
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"certs", "init", "--authority", authority},
           {"certs", "issue", "hub", "--host", "127.0.0.1", "--authority", authority},
           {"certs", "issue", "ann", "--role", "reader", "--authority", authority}}) {
    ASSERT_EQ(run_weft(folder, arguments).code, 0);
  }
  ChildProcess coordinator({program("weft-coordinator"), "--listen", "127.0.0.1:0", "--state",
                            folder / "state", "--tls-folder", folder / "hub"},
                           folder / "coordinator.log", true);
  const std::string ready = coordinator.read_line(20).value_or("");
  const std::string address = ready.substr(ready.rfind(' ') + 1);
  const std::string tiny = std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto";
  const auto as_ann = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--coordinator", address, "--tls-folder", folder / "ann"});
    return run_weft(folder, arguments);
  };
  const std::vector<Use> uses{
      {0, {"jobs"}},         {0, {"fabrics"}},     {4, {"submit", tiny}},   {4, {"gc"}},
      {4, {"cancel", "j1"}}, {4, {"drain", "w1"}}, {4, {"tag", "a@1", "b"}}};
  for (const Use& use : uses) {
    expect_code(as_ann(use.arguments), use);
  }
}

}  // namespace
}  // namespace weft::cli
