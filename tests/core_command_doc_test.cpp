#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/command_doc.h"
#include "core/completion.h"
#include "core/help_text.h"
#include "core/man_page.h"
#include "core/program.h"

namespace weft::core {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// A program with two commands, one of which has commands.
struct SmallProgram {
  CLI::App app{"loom weaves."};
  std::string fabric;
  std::string quality;
  std::string output = "out.h5";
  int count = 3;
  bool is_dry = false;

  SmallProgram() {
    set_program_name(app, "loom");
    CLI::App* weave = app.add_subcommand("weave", "Weave a fabric.");
    weave->group("Work");
    weave->footer("Until it is\ndone.\nExamples: loom weave silk\n          loom weave -n 2 linen");
    weave->add_option("fabric", fabric, "What to weave")->required();
    weave->add_option("--quality", quality, "How well\nit is woven")
        ->check(CLI::IsMember({"low", "high"}))
        ->envname("LOOM_QUALITY");
    weave->add_option("-o,--output", output, "Where to")->capture_default_str();
    weave->add_option("-n,--count", count, "How many")->check(CLI::Range(1, 9));
    weave->add_flag("--dry-run", is_dry, "Only say what would be done");
    weave->add_flag("--secret", is_dry, "Not for you")->group("");
    CLI::App* certs = app.add_subcommand("certs", "Make certificates.");
    certs->add_subcommand("init", "Make an authority.");
  }
};

std::vector<std::string> words_of(const Completions& completions) {
  std::vector<std::string> words;
  for (const Completion& completion : completions.words) {
    words.push_back(completion.word);
  }
  return words;
}

TEST(CommandDoc, SaysWhatTheApplicationDeclares) {
  const SmallProgram program;
  const CommandDoc doc = describe(program.app);
  ASSERT_EQ(doc.commands.size(), 2U);
  const CommandDoc& weave = doc.commands[0];
  EXPECT_EQ(weave.path, "loom weave");
  EXPECT_EQ(weave.group, "Work");
  EXPECT_THAT(weave.text, ElementsAre("Until it is done."));
  EXPECT_THAT(weave.examples, ElementsAre("loom weave silk", "loom weave -n 2 linen"));
  ASSERT_EQ(weave.arguments.size(), 1U);
  EXPECT_EQ(weave.arguments[0].names.front(), "FABRIC");
  EXPECT_TRUE(weave.arguments[0].is_required);
  ASSERT_EQ(weave.options.size(), 5U);  // the hidden one is not among them
  EXPECT_EQ(weave.options[0].text, "How well it is woven");
  EXPECT_EQ(weave.options[0].environment, "LOOM_QUALITY");
  EXPECT_THAT(weave.options[0].choices, ElementsAre("low", "high"));
  EXPECT_EQ(weave.options[1].default_text, "out.h5");
  EXPECT_EQ(weave.options[1].value, "FILE");
  EXPECT_TRUE(weave.options[2].is_number);
  EXPECT_EQ(weave.options[3].value, "");
  EXPECT_TRUE(weave.options[4].is_called("--help"));
}

TEST(HelpText, HoldsUsageOptionsAndExamplesInNarrowLines) {
  const SmallProgram program;
  const CommandDoc doc = describe(program.app);
  const std::string text = help_text(doc.commands[0]);
  EXPECT_THAT(text, HasSubstr("Usage: loom weave [OPTIONS] FABRIC\n"));
  EXPECT_THAT(text, HasSubstr("  -o, --output FILE       Where to [default: out.h5]\n"));
  EXPECT_THAT(text, HasSubstr("[one of low, high; or LOOM_QUALITY]"));
  EXPECT_THAT(text, HasSubstr("Examples:\n  loom weave silk\n  loom weave -n 2 linen\n"));
  EXPECT_THAT(text, Not(HasSubstr("secret")));
  EXPECT_THAT(help_text(doc), HasSubstr("Work:\n  weave       Weave a fabric.\n"));
}

TEST(ManPage, HasTheSectionsOfOneAndEscapesWhatRoffWouldTake) {
  SmallProgram program;
  program.app.get_subcommand("weave")->footer(".dots and 'quotes' and a back\\slash.\nExample: x");
  const std::string page = man_page(describe(program.app).commands[0], 1);
  for (const char* section : {"NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "ENVIRONMENT", "FILES",
                              "EXIT STATUS", "EXAMPLES", "SEE ALSO"}) {
    EXPECT_THAT(page, HasSubstr(std::string("\n.SH ") + section + "\n"));
  }
  EXPECT_THAT(page, HasSubstr("loom\\-weave \\- Weave a fabric\n"));
  EXPECT_THAT(page, HasSubstr("\n\\&.dots and \\(aqquotes\\(aq and a back\\eslash.\n"));
  EXPECT_THAT(page, HasSubstr("\\fBLOOM_QUALITY\\fR"));
}

TEST(Completion, KnowsCommandsOptionsChoicesAndFiles) {
  const SmallProgram program;
  const CommandDoc doc = describe(program.app);
  EXPECT_THAT(words_of(complete(doc, {""})), ElementsAre("weave", "certs"));
  EXPECT_THAT(words_of(complete(doc, {"we"})), ElementsAre("weave"));
  EXPECT_THAT(words_of(complete(doc, {"certs", "i"})), ElementsAre("init"));
  EXPECT_THAT(words_of(complete(doc, {"weave", "--o"})), ElementsAre("--output"));
  EXPECT_THAT(words_of(complete(doc, {"weave", "--quality", ""})), ElementsAre("low", "high"));
  EXPECT_THAT(words_of(complete(doc, {"weave", "--quality=h"})), ElementsAre("--quality=high"));
  EXPECT_FALSE(complete(doc, {"weave", "--quality", "x"}).takes_files);
  EXPECT_TRUE(complete(doc, {"weave", "-o", ""}).takes_files);
  EXPECT_FALSE(complete(doc, {"weave", "-n", ""}).takes_files);
  EXPECT_TRUE(complete(doc, {"weave", "--dry-run", ""}).takes_files);
  EXPECT_FALSE(complete(doc, {"weave", "silk", ""}).takes_files);
  EXPECT_TRUE(complete(doc, {"weave", "--", "-"}).takes_files);
}

TEST(Completion, AsksForNamesAndKeepsThoseThatBeginAsTyped) {
  const SmallProgram program;
  const CommandDoc doc = describe(program.app);
  const CompletionSource source = [](const CompletionPlace& place) -> std::optional<Completions> {
    EXPECT_EQ(place.command, "weave");
    EXPECT_EQ(place.argument, "FABRIC");
    EXPECT_THAT(place.words_before, ElementsAre("weave", "-n", "2"));
    return Completions{{{"silk", "published"}, {"linen", ""}}, false};
  };
  const Completions found = complete(doc, {"weave", "-n", "2", "s"}, source);
  EXPECT_EQ(completions_text(found), "silk\tpublished\n:\n");
}

}  // namespace
}  // namespace weft::core
