#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "fabric/dtx.h"
#include "fabric/read_draft.h"
#include "fabric/wif_write.h"

namespace weft::fabric {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Four ends, four picks; the last row of the tie-up is shaft 1, as Fiberworks has it.
std::string twill() {
  return "@@StartDTX\n%%version 1\n\n@@Description\ntwill of four\n\n@@Contents\nInfo\n\n"
         "@@Imprint\nPCW 4.2.0 Silver\n\n@@Info\n%%shafts 4 \n%%treadles 4\n%%ends 4\n%%picks 4\n\n"
         "@@Threading\n1  2  3  4  \n\n@@Tieup\n0011\n0110\n1100\n1001\n\n"
         "@@Treadling\n1  2  3  4\n\n@@Color Palet\n255,255,255\n255,0,0\n0,0,51\n\n"
         "@@Warp Colors\n1 1 2 2\n\n@@Weft Colors\n0 0 0 0\n\n@@Warp Spacing\n4 4 4 4\n\n"
         "@@EndDTX\n";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::vector<std::string> rows(const WifDraft& draft) {
  std::vector<std::string> result(draft.weft.count);
  for (std::size_t i = 0; i < draft.up.size(); ++i) {
    result[i / draft.warp.count] += draft.up[i] != 0 ? 'X' : '.';
  }
  return result;
}

std::string message(const std::string& text) {
  try {
    (void)read_dtx(text, "d.dtx");
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    return error.what();
  }
  return "nothing was wrong";
}

TEST(Dtx, ReadsThreadingTieUpAndTreadling) {
  const WifDraft draft = read_dtx(twill(), "twill.dtx");
  EXPECT_EQ(draft.title, "twill of four");
  EXPECT_EQ(draft.source_program, "Fiberworks (PCW 4.2.0 Silver)");
  // Treadle 1 lifts shafts 1 and 2: the columns of the tie-up, from below.
  EXPECT_THAT(rows(draft), ElementsAre("XX..", ".XX.", "..XX", "X..X"));
  EXPECT_THAT(draft.warp.colours, ElementsAre(2, 2, 3, 3));
  EXPECT_THAT(draft.weft.colours, ElementsAre(1, 1, 1, 1));
  EXPECT_DOUBLE_EQ(draft.colours.at(3)[2], 0.2);
  EXPECT_DOUBLE_EQ(draft.warp.spacing_mm, 2.12);
  EXPECT_DOUBLE_EQ(draft.weft.spacing_mm, 0);
}

TEST(Dtx, SeveralTreadlesOfAPickHaveCommas) {
  for (const char* treadling : {"1,2  2, 3  3 ,4 4,1", "%%compound\n1,2\n2,3 3,\n4 1,4"}) {
    const WifDraft draft = read_dtx(
        replaced(twill(), "1  2  3  4\n\n@@Col", std::string(treadling) + "\n\n@@Col"), "c.dtx");
    EXPECT_THAT(rows(draft), ElementsAre("XXX.", ".XXX", "X.XX", "XX.X")) << treadling;
  }
}

TEST(Dtx, ASinkingShedIsTheOtherWayRound) {
  for (const char* mark : {"%%sinking", "%%%%sinking"}) {
    const WifDraft draft =
        read_dtx(replaced(twill(), "@@Tieup\n", std::string("@@Tieup\n") + mark + "\n"), "s.dtx");
    EXPECT_THAT(rows(draft), ElementsAre("..XX", "X..X", "XX..", ".XX.")) << mark;
  }
}

TEST(Dtx, ALiftPlanCountsShaftsFromTheLeft) {
  const std::string text = "@@StartDTX\n@@Threading\n1 2\n0 1\n@@Liftplan\n10\n01\n@@EndDTX\n";
  const WifDraft draft = read_dtx(text, "l.dtx");
  EXPECT_THAT(rows(draft), ElementsAre("X..X", ".X.."));
  EXPECT_THAT(draft.notes, ::testing::Contains(HasSubstr("the warp is white and the weft blue")));
}

TEST(Dtx, TakesTheLinesOfAllMachinesAndUnknownSections) {
  std::string text = twill() + "@@Fluff\nwhatever = here\n";
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2) {
    text.replace(at, 1, "\r\n");
  }
  const WifDraft draft = read_dtx("\xef\xbb\xbf" + text, "crlf.dtx");
  EXPECT_EQ(rows(draft), rows(read_dtx(twill(), "twill.dtx")));
  EXPECT_THAT(draft.notes, ::testing::Contains("not known and ignored: @@Fluff"));
}

TEST(Dtx, ThreadsBeyondTheListOfSpacingsHaveTheUsualOne) {
  const WifDraft draft =
      read_dtx(replaced(twill(), "@@Warp Spacing\n4 4 4 4", "@@Warp Spacing\n3 2 1"), "w.dtx");
  EXPECT_FALSE(draft.warp.even);
  EXPECT_DOUBLE_EQ(draft.warp.spacing_mm, (3 + 2 + 1 + 4) / 4.0 * 0.53);
}

TEST(Dtx, EveryMistakeNamesItsLine) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "d.dtx:1: the file has no @@Section"},
      {"hello\n", "d.dtx:1: \"hello\" stands before the first section"},
      {"@@StartDTX\n@@Threading\n1 2\n", "@@treadling is missing; a draft needs it with a @@Tieup"},
      {replaced(twill(), "1  2  3  4  \n", "1  2  3  5\n"),
       "d.dtx:20: @@Threading gives end 4 the shaft 5, there are 4; correct it, or %%shafts"},
      {replaced(twill(), "1  2  3  4  \n", "1  2  3\n"),
       "d.dtx:19: @@Threading has 3 ends, @@Info states 4; correct one of the two"},
      {replaced(twill(), "1  2  3  4  \n", "1  2  x  4\n"),
       "d.dtx:20: @@Threading has \"x\"; a whole number from 0 to 4096 is needed"},
      {replaced(twill(), "0110\n", "01102\n"), "d.dtx:24: @@Tieup has a row of 5 marks"},
      {replaced(twill(), "0110\n", "01x0\n"), "d.dtx:24: @@Tieup has the row \"01x0\""},
      {replaced(twill(), "255,0,0", "255,0"), "d.dtx:33: @@Color Palet colour 2 is not red"},
      {replaced(twill(), "1 1 2 2", "1 1 2 3"),
       "d.dtx:36: @@Warp Colors uses colour 3, the palette ends at 2 (counted from 0)"},
      {replaced(twill(), "4 4 4 4", "4 4 4 4 4"),
       "@@Warp Spacing has 5 numbers, there are 4 threads"},
      {replaced(twill(), "0 0 0 0", "0 0 0"), "@@Weft Colors has 3 numbers, there are 4 threads"},
      {replaced(twill(), "%%ends 4", "%%ends four"), "@@Info states %%ends \"four\""},
      {twill() + "@@Tieup\n01\n", "@@Tieup stands a second time"},
      {replaced(twill(), "1  2  3  4\n\n@@Col", "1,,2 3 4\n\n@@Col"),
       "has a comma without a number before it"},
      {replaced(twill(), "1  2  3  4\n\n@@Col", "1 2 3 4,\n\n@@Col"), "ends in a comma"}};
  for (const auto& [text, expected] : cases) {
    EXPECT_THAT(message(text), HasSubstr(expected));
  }
}

TEST(Dtx, ACutFileIsReadOrRefusedButNothingElse) {
  const std::string whole = twill();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    try {
      const WifDraft draft = read_dtx(whole.substr(0, size), "cut.dtx");
      EXPECT_EQ(draft.up.size(), std::size_t{draft.warp.count} * draft.weft.count);
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    }
  }
}

TEST(Dtx, WrittenAsWifItReadsTheSame) {
  const WifDraft draft = read_dtx(twill(), "twill.dtx");
  const WifDraft again = read_wif(write_wif(draft), "written.wif");
  EXPECT_EQ(rows(again), rows(draft));
  EXPECT_EQ(again.warp.colours, draft.warp.colours);
  EXPECT_EQ(again.weft.colours, draft.weft.colours);
  EXPECT_EQ(again.colours, draft.colours);
  EXPECT_NEAR(again.warp.spacing_mm, draft.warp.spacing_mm, 1e-4);
  EXPECT_EQ(again.title, draft.title);
  EXPECT_THAT(again.notes, ::testing::IsEmpty());
}

TEST(Dtx, FormatsAreToldByNameAndElseByContents) {
  EXPECT_EQ(draft_format("", "a.DTX"), DraftFormat::kDtx);
  EXPECT_EQ(draft_format(twill(), "a"), DraftFormat::kDtx);
  EXPECT_EQ(draft_format(twill(), "a.wif"), DraftFormat::kWif);
  EXPECT_EQ(draft_format("[WIF]\n", "a.txt"), DraftFormat::kWif);
  EXPECT_EQ(draft_format("{\x07\x65", "a"), DraftFormat::kWpo);
}

}  // namespace
}  // namespace weft::fabric
