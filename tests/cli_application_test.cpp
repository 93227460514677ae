#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/application.h"
#include "core/command_doc.h"
#include "core/help_text.h"
#include "core/man_page.h"
#include "core/settings.h"
#include "tests/cli_programs.h"

// What holds of every command there is, now and later.

namespace weft::cli {
namespace {

core::CommandDoc weft_doc() {
  CLI::App app;
  build_application(app);
  return core::describe(app);
}

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

TEST(Application, EveryCommandIsInAGroupAndExplainedWithAnExample) {
  std::set<std::string> groups;
  for (const core::CommandDoc& command : weft_doc().commands) {
    groups.insert(command.group);
    EXPECT_NE(command.group, "Commands") << command.path;
    EXPECT_LE(command.summary.size(), 76U) << command.path;
    ASSERT_FALSE(command.examples.empty()) << command.path;
    for (const std::string& example : command.examples) {
      EXPECT_TRUE(example.find(command.path) != std::string::npos) << example;
    }
  }
  EXPECT_GE(groups.size(), 5U);
}

void expect_explained(const core::CommandDoc& doc) {
  for (const auto* options : {&doc.arguments, &doc.options}) {
    for (const core::OptionDoc& option : *options) {
      EXPECT_NE(option.text, "") << doc.path << " " << option.names.front();
    }
  }
  for (const core::CommandDoc& command : doc.commands) {
    expect_explained(command);
  }
}

TEST(Application, EveryOptionIsExplained) { expect_explained(weft_doc()); }

TEST(Application, SharedSettingsAreOptionsWithTheVariableThatTheySay) {
  const core::CommandDoc doc = weft_doc();
  for (const core::SharedSetting& setting : core::shared_settings()) {
    const std::string name = std::string("--") + setting.key;
    int users = 0;
    for (const core::CommandDoc& command : doc.commands) {
      for (const core::OptionDoc& option : command.options) {
        if (option.is_called(name)) {
          ++users;
          EXPECT_EQ(option.environment, setting.variable) << command.path << " " << name;
        }
      }
    }
    EXPECT_GT(users, 0) << name;
  }
}

TEST(Application, HelpGroupsTheCommandsAndShowsThreeExamples) {
  const TestFolder folder;
  const Finished help = run_weft(folder, {"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_EQ(help.out, core::help_text(weft_doc()));
  EXPECT_EQ(weft_doc().examples.size(), 3U);
  EXPECT_NE(help.out.find("\nPrecompute it:\n"), std::string::npos);
  const Finished submit = run_weft(folder, {"submit", "--help"});
  EXPECT_EQ(submit.out, core::help_text(*weft_doc().find("submit")));
}

TEST(Application, EveryCommandHasAManualPageThatMandocFindsNothingWrongWith) {
  if (std::system("command -v mandoc >/dev/null") != 0) {  // NOLINT(concurrency-mt-unsafe)
    GTEST_SKIP() << "mandoc is not installed";
  }
  const TestFolder folder;
  ASSERT_EQ(run_weft(folder, {"man", "--all", folder / "pages"}).code, 0);
  std::vector<std::string> command{"/usr/bin/env", "mandoc", "-T", "lint", "-W", "warning"};
  for (const auto& page : std::filesystem::directory_iterator(folder / "pages")) {
    command.push_back(page.path().string());
  }
  EXPECT_EQ(command.size(), 6 + 1 + weft_doc().commands.size());
  for (const char* service : {"weft-coordinator", "weft-worker", "weft-render"}) {
    ChildProcess page({program(service), "__man"}, folder / "service.err", true);
    std::string text;
    while (const auto line = page.read_line(20)) {
      text += *line + "\n";
    }
    EXPECT_EQ(first_line(text).substr(0, 9), ".TH \"weft");
    command.push_back(folder / (std::string(service) + ".8"));
    core::write_file_atomically(command.back(), text);
  }
  ChildProcess lint(command, folder / "lint.log", false);
  EXPECT_EQ(lint.wait(60), 0) << core::read_file(folder / "lint.log");
}

TEST(Application, AManualPageIsPrintedAndAnUnknownOneIsNotFound) {
  const TestFolder folder;
  EXPECT_EQ(run_weft(folder, {"man", "submit"}).out, core::man_page(*weft_doc().find("submit"), 1));
  EXPECT_EQ(run_weft(folder, {"man", "sumbit"}).code, 3);
}

TEST(Application, AMistypedCommandIsAnsweredWithTheNearest) {
  const TestFolder folder;
  const Finished finished = run_weft(folder, {"sumbit"});
  EXPECT_EQ(finished.code, 2);
  EXPECT_NE(finished.err.find("did you mean \"submit\"?"), std::string::npos) << finished.err;
}

}  // namespace
}  // namespace weft::cli
