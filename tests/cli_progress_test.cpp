#include <cstdio>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cli/progress.h"

namespace weft::cli {
namespace {

// What a printer wrote into a temporary file.
std::string printed(const std::vector<std::vector<StageProgress>>& states, bool is_terminal) {
  std::FILE* file = std::tmpfile();
  EXPECT_NE(file, nullptr);
  ProgressPrinter printer(file, is_terminal);
  for (const auto& state : states) {
    printer.update(state);
  }
  printer.finish(states.back());
  std::string text(static_cast<std::size_t>(std::ftell(file)), '\0');
  std::rewind(file);
  EXPECT_EQ(std::fread(text.data(), 1, text.size(), file), text.size());
  std::fclose(file);
  return text;
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

TEST(Progress, Duration_IsWrittenInTheUnitsPeopleUse) {
  EXPECT_EQ(format_duration(0.44), "0.4 s");
  EXPECT_EQ(format_duration(9.94), "9.9 s");
  EXPECT_EQ(format_duration(9.96), "10 s");
  EXPECT_EQ(format_duration(59.6), "1 min 00 s");
  EXPECT_EQ(format_duration(200), "3 min 20 s");
  EXPECT_EQ(format_duration(7500), "2 h 05 min");
  EXPECT_EQ(format_duration(-1), "?");
}

TEST(Progress, Bytes_KeepTwoDigits) {
  EXPECT_EQ(format_bytes(0), "0 B");
  EXPECT_EQ(format_bytes(1023), "1023 B");
  EXPECT_EQ(format_bytes(1536), "1.5 KiB");
  EXPECT_EQ(format_bytes(20U << 20U), "20 MiB");
}

TEST(Progress, TimeLeft_CountsOnlyShardsThatWereComputed) {
  // 10 of 40 computed in 5 s, 50 more came from the cache: 40 left at 2 per second.
  const StageProgress stage{"transfer", 60, 100, 50, 5};
  EXPECT_DOUBLE_EQ(seconds_left(stage), 20);
  const StageProgress all_cached{"transfer", 50, 100, 50, 5};
  EXPECT_LT(seconds_left(all_cached), 0) << "without a rate there is no time left to state";
}

TEST(Progress, TerminalLine_ShowsBarShareRateAndTimeLeft) {
  EXPECT_EQ(stage_line({"visibility", 50, 100, 0, 10}),
            "visibility     [############............] 50/100 50 %  5.0/s, 10 s left");
  EXPECT_EQ(stage_line({"transfer", 0, 0, 0, 0}), "transfer       waiting");
  EXPECT_EQ(stage_line({"grid", 1, 1, 0, 2}), "grid           1 done in 2.0 s");
  EXPECT_EQ(stage_line({"grid", 1, 1, 1, 0}),
            "grid           1 done in 0.0 s, 1 of them from the cache");
}

TEST(Progress, PlainLine_NamesOnlyWhatIsUnderWay) {
  EXPECT_EQ(plain_line({{"geometry", 1, 1, 0, 1},
                        {"visibility", 1, 600, 0, 10},
                        {"transfer", 0, 70, 0, 1},
                        {"basis", 0, 0, 0, 0}}),
            "visibility 1/600 (6.0/min, 1 h 39 min left); transfer 0/70");
}

TEST(Progress, PlainPrinter_SaysOnceThatAStageIsDoneAndUsesNoControlCharacters) {
  const std::vector<StageProgress> begun{{"geometry", 0, 1, 0, 0}, {"grid", 0, 0, 0, 0}};
  const std::vector<StageProgress> ended{{"geometry", 1, 1, 0, 1}, {"grid", 0, 1, 0, 0}};
  const std::string text = printed({begun, ended, ended}, false);
  EXPECT_EQ(count_of(text, "geometry: 1 done in 1.0 s"), 1U) << text;
  EXPECT_EQ(count_of(text, "\x1b"), 0U) << text;
  EXPECT_EQ(count_of(text, "\r"), 0U) << text;
}

TEST(Progress, TerminalPrinter_RedrawsItsLinesInPlace) {
  const std::vector<StageProgress> begun{{"geometry", 0, 1, 0, 0}, {"grid", 0, 0, 0, 0}};
  const std::vector<StageProgress> ended{{"geometry", 1, 1, 0, 1}, {"grid", 1, 1, 0, 0}};
  const std::string text = printed({begun, ended}, true);
  EXPECT_EQ(count_of(text, "\x1b[2A"), 1U) << text;
  EXPECT_EQ(count_of(text, "\n"), 4U) << text;
}

}  // namespace
}  // namespace weft::cli
