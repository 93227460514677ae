#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "fabric/draft.h"
#include "fabric/wif.h"

namespace weft::fabric {
namespace {

using ::testing::HasSubstr;

// A 2/2 twill on four shafts, as text whose parts the tests replace.
std::string twill() {
  return "[WIF]\n"             // 1
         "Version=1.1\n"       // 2
         "[CONTENTS]\n"        // 3
         "THREADING=true\n"    // 4
         "[WEAVING]\n"         // 5
         "Shafts=4\n"          // 6
         "Treadles=4\n"        // 7
         "Rising Shed=true\n"  // 8
         "[WARP]\n"            // 9
         "Threads=4\n"         // 10
         "Color=1\n"           // 11
         "Units=centimeters\n"
         "Spacing=0.05\n"
         "Thickness=0.04\n"
         "[WEFT]\n"     // 15
         "Threads=4\n"  // 16
         "Color=2\n"
         "Units=decipoints\n"
         "Spacing=36\n"
         "[COLOR PALETTE]\n"  // 20
         "Range=0,999\n"      // 21
         "[COLOR TABLE]\n"    // 22
         "1=999,0,0\n"        // 23
         "2=0,999,333\n"      // 24
         "[THREADING]\n"      // 25
         "1=1\n2=2\n3=3\n4=4\n"
         "[TIEUP]\n"  // 30
         "1=1,2\n2=2,3\n3=3,4\n4=4,1\n"
         "[TREADLING]\n"  // 35
         "1=1\n2=2\n3=3\n4=4\n";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string replaced_everywhere(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
  return text;
}

std::vector<std::string> rows(const WifDraft& draft) {
  std::vector<std::string> result;
  for (std::size_t pick = 0; pick < draft.weft.count; ++pick) {
    result.emplace_back();
    for (std::size_t end = 0; end < draft.warp.count; ++end) {
      result.back() += draft.up[pick * draft.warp.count + end] != 0 ? 'X' : '.';
    }
  }
  return result;
}

const std::vector<std::string> kTwill{"XX..", ".XX.", "..XX", "X..X"};

TEST(Wif, ATwillIsDrawnDownWithColoursAndLengths) {
  const WifDraft draft = read_wif(twill(), "twill.wif");
  EXPECT_EQ(rows(draft), kTwill);
  EXPECT_EQ(draft.warp.colours, std::vector<std::uint32_t>(4, 1));
  EXPECT_EQ(draft.weft.colours, std::vector<std::uint32_t>(4, 2));
  EXPECT_NEAR(draft.colours.at(2)[2], 333.0 / 999, 1e-12);
  EXPECT_NEAR(draft.warp.spacing_mm, 0.5, 1e-12);
  EXPECT_NEAR(draft.warp.thickness_mm, 0.4, 1e-12);
  EXPECT_NEAR(draft.weft.spacing_mm, 36 * 25.4 / 720, 1e-12);
  EXPECT_EQ(draft.notes, std::vector<std::string>{});
}

TEST(Wif, TheSameDraftIsReadFromEveryWayOfWritingIt) {
  std::string utf16 = "\xff\xfe";
  for (const char c : twill()) {
    utf16 += c;
    utf16 += '\0';
  }
  std::string shouting = twill();
  for (char& c : shouting) {
    c = static_cast<char>(std::toupper(c));
  }
  std::string whispering = twill();
  for (char& c : whispering) {
    c = static_cast<char>(std::tolower(c));
  }
  const std::vector<std::string> ways{
      replaced_everywhere(twill(), "\n", "\r\n"),
      replaced_everywhere(twill(), "\n", "\r"),
      replaced_everywhere(twill(), "\n", "\n; a comment\n\n"),
      replaced_everywhere(twill(), "=", "  =\t "),
      "\xef\xbb\xbf" + twill(),
      utf16,
      shouting,
      whispering,
      replaced(twill(), "[THREADING]", "[  threading  ] ; from right to left"),
      replaced(twill(), "1=1,2\n", "1= 1 , 2, ; comment\n"),
      replaced(twill(), "1=1,2\n", "1=0,2,1,1\n"),
      replaced(twill(), "Rising Shed=true", "Rising Shed=yes"),
      replaced(twill(), "Rising Shed=true", "RISING SHED=On"),
      replaced(twill(), "Rising Shed=true", "Rising Shed=1"),
      replaced(twill(), "[THREADING]",
               "[TEXT]\nTitle=Gr\xfc\xdf"
               "e; an Anna\nfree text\n[THREADING]"),
      replaced(twill(), "[THREADING]", "[PRIVATE ACME]\nwhat ever\n[THREADING]"),
      replaced(twill(), "[THREADING]\n1=1\n2=2\n3=3\n4=4\n", "[THREADING]\n0=1\n1=2\n2=3\n3=4\n"),
      replaced(twill(), "Shafts=4\nTreadles=4\n", ""),
      replaced(twill(), "Threads=4\n", ""),
      replaced(twill(), "[CONTENTS]\nTHREADING=true\n", ""),
  };
  for (std::size_t i = 0; i < ways.size(); ++i) {
    EXPECT_EQ(rows(read_wif(ways[i], "twill.wif")), kTwill) << "way " << i;
  }
}

TEST(Wif, ASinkingShedTurnsTheClothOver) {
  const WifDraft draft =
      read_wif(replaced(twill(), "Rising Shed=true", "Rising Shed=False"), "twill.wif");
  EXPECT_EQ(rows(draft), (std::vector<std::string>{"..XX", "X..X", "XX..", ".XX."}));
}

TEST(Wif, ALiftplanReplacesTieupAndTreadling) {
  const std::string text =
      twill().substr(0, twill().find("[TIEUP]")) + "[LIFTPLAN]\n1=1,2\n2=3,2\n3=0\n4=4,1\n";
  const WifDraft draft = read_wif(text, "lift.wif");
  EXPECT_EQ(rows(draft), (std::vector<std::string>{"XX..", ".XX.", "....", "X..X"}));
  EXPECT_THAT(draft.notes, ::testing::Contains("[LIFTPLAN] gives 1 pick no shaft"));
}

TEST(Wif, SeveralTreadlesAndSeveralShaftsAddUp) {
  const WifDraft treadles =
      read_wif(replaced(twill(), "[TREADLING]\n1=1", "[TREADLING]\n1=1,3"), "twill.wif");
  EXPECT_EQ(rows(treadles)[0], "XXXX");
  const WifDraft shafts =
      read_wif(replaced(twill(), "[THREADING]\n1=1", "[THREADING]\n1=1,3"), "twill.wif");
  EXPECT_EQ(rows(shafts), (std::vector<std::string>{"XX..", "XXX.", "X.XX", "X..X"}));
}

TEST(Wif, GapsAreFilledAndReported) {
  std::string text =
      replaced(twill(), "[TREADLING]\n1=1\n2=2\n3=3\n4=4\n", "[TREADLING]\n1=1\n3=0\n4=4\n");
  text = replaced(text, "[COLOR TABLE]\n1=999,0,0\n2=0,999,333\n", "[COLOR TABLE]\n1=0,0,999\n");
  text += "[WARP COLORS]\n2=7\n9=1\n";
  text = replaced(text, "Rising Shed=true\n", "");
  const WifDraft draft = read_wif(text, "gaps.wif");
  EXPECT_EQ(rows(draft), (std::vector<std::string>{"XX..", "....", "....", "X..X"}));
  EXPECT_EQ(draft.warp.colours, (std::vector<std::uint32_t>{1, 7, 1, 1}));
  EXPECT_EQ(draft.notes,
            (std::vector<std::string>{
                "[WEAVING] does not state its Rising Shed; true is taken",
                "[TREADLING] leaves out 1 pick; no treadle is taken for them",
                "[TREADLING] gives 1 pick no treadle",
                "[WARP COLORS] has 1 entries beyond the 4 there are; they are ignored",
                "[WARP] uses colour 7, which [COLOR TABLE] lacks; it is a stand-in",
                "[WEFT] uses colour 2, which [COLOR TABLE] lacks; it is a stand-in",
                "1 end and 2 picks never change sides: they lie on the cloth without being "
                "bound"}));
}

TEST(Wif, ThreadsMayHaveColoursAndLengthsOfTheirOwn) {
  const WifDraft draft = read_wif(twill() +
                                      "[WARP COLORS]\n1=2\n2=0,0,999\n3=5,999,999,0\n"
                                      "[WARP SPACING]\n1=0.15\n[WARP THICKNESS]\n4=0\n",
                                  "own.wif");
  EXPECT_EQ(draft.warp.colours, (std::vector<std::uint32_t>{2, 3, 5, 1}));
  EXPECT_EQ(draft.colours.at(3), (std::array<double, 3>{0, 0, 1}));
  EXPECT_EQ(draft.colours.at(5), (std::array<double, 3>{1, 1, 0}));
  EXPECT_NEAR(draft.warp.spacing_mm, 0.75, 1e-12);
  EXPECT_NEAR(draft.warp.thickness_mm, 0.3, 1e-12);
  EXPECT_FALSE(draft.warp.even);
}

TEST(Wif, ARangeThatIsTooSmallIsRepaired) {
  const WifDraft draft = read_wif(replaced(twill(), "Range=0,999", "Range=0,255"), "range.wif");
  EXPECT_EQ(draft.colours.at(1)[0], 1.0);
  EXPECT_THAT(draft.notes,
              ::testing::Contains("[COLOR TABLE] has a component of 999 in a range that ends at "
                                  "255; the range is taken to end at 999"));
  const WifDraft wide = read_wif(
      replaced(replaced(twill(), "Range=0,999", "Range=0,65535"), "1=999,0,0", "1=65535,0,0"), "w");
  EXPECT_EQ(wide.colours.at(1)[0], 1.0);
}

struct Broken {
  std::string text;
  std::string message;
};

TEST(Wif, BrokenFilesAreRefusedWithSectionAndLine) {
  const std::vector<Broken> table{
      {"", "b.wif:1: the file has no [SECTION]; this is no weaving draft in WIF format"},
      {"hello\n",
       "b.wif:1: \"hello\" stands before the first [SECTION]; a WIF file begins with [WIF]"},
      {"\n[WIF\n", "b.wif:2: the section name \"[WIF\" has no closing bracket; write [NAME]"},
      {"[WIF]\n", "b.wif:1: [THREADING] is missing; a draft needs one line per end, such as 1=1"},
      {replaced(twill(), "[THREADING]\n1=1\n2=2\n3=3\n4=4\n", "[THREADING]\n"),
       "b.wif:25: [THREADING] is empty; a draft needs one line per end, such as 1=1"},
      {replaced(twill(), "[THREADING]\n1=1", "[THREADING]\n1=5"),
       "b.wif:26: [THREADING] end 1 names shaft 5, there are 4; correct it, or the number in "
       "[WEAVING]"},
      {replaced(twill(), "[THREADING]\n1=1", "[THREADING]\n1=one"),
       "b.wif:26: [THREADING] 1=\"one\": \"one\" is not a whole number from 0 to 32768"},
      {replaced(twill(), "[THREADING]\n1=1", "[THREADING]\n1=-1"),
       "b.wif:26: [THREADING] 1=\"-1\": \"-1\" is not a whole number from 0 to 32768"},
      {replaced(twill(), "[THREADING]\n1=1", "[THREADING]\nx=1"),
       "b.wif:26: [THREADING] \"X\" is no number; the keys of this section are numbers from 1 on"},
      {replaced(twill(), "[THREADING]\n1=1", "[THREADING]\n1"),
       "b.wif:26: [THREADING] \"1\" has no '='; write number=value"},
      {replaced(twill(), "[THREADING]\n1=1", "[THREADING]\n5=1"),
       "b.wif:26: [THREADING] end 5 is beyond the 4 that the file states; correct one of the two"},
      {replaced(twill(), "[TREADLING]\n1=1", "[TREADLING]\n1=9"),
       "b.wif:36: [TREADLING] pick 1 names treadle 9, there are 4; correct it, or the number in "
       "[WEAVING]"},
      {twill().substr(0, twill().find("[TREADLING]")),
       "b.wif:1: [TREADLING] is missing; add it with a [TIEUP], or add a [LIFTPLAN]"},
      {replaced(twill(), "[TIEUP]\n1=1,2\n2=2,3\n3=3,4\n4=4,1\n", ""),
       "b.wif:1: [TIEUP] is missing; [TREADLING] needs it; or add a [LIFTPLAN]"},
      {replaced(twill(), "1=1,2", "1=1,7"),
       "b.wif:31: [TIEUP] treadle 1 names shaft 7, there are 4; correct it, or the number in "
       "[WEAVING]"},
      {replaced(twill(), "Threads=4", "Threads=0"),
       "b.wif:10: [WARP] Threads is 0; a draft needs at least one thread"},
      {replaced(twill(), "Threads=4", "Threads=1000000000"),
       "b.wif:10: [WARP] THREADS=\"1000000000\": \"1000000000\" is not a whole number from 0 to "
       "32768"},
      {replaced(replaced(twill(), "Threads=4", "Threads=32768"), "Threads=4\n", "Threads=32768\n"),
       "b.wif:1: the draft has 32768 ends and 32768 picks; at most 67108864 crossings are "
       "possible"},
      {replaced(twill(), "Rising Shed=true", "Rising Shed=perhaps"),
       "b.wif:8: [WEAVING] RISING SHED is \"perhaps\"; write true or false"},
      {replaced(twill(), "Range=0,999", "Range=9"),
       "b.wif:21: [COLOR PALETTE] Range is \"9\"; write the least and the greatest, such as 0,255"},
      {replaced(twill(), "1=999,0,0", "1=999,0"),
       "b.wif:23: [COLOR TABLE] colour 1 is \"999,0\"; write red,green,blue"},
      {replaced(twill(), "Spacing=0.05", "Spacing=wide"),
       "b.wif:13: [WARP] SPACING is \"wide\"; a number is needed, such as 0.212"},
      {replaced(twill(), "Spacing=0.05", "Spacing=nan"),
       "b.wif:13: [WARP] SPACING is \"nan\"; a number is needed, such as 0.212"},
      {replaced(twill(), "Spacing=0.05", "Spacing=-1"),
       "b.wif:13: [WARP] SPACING is negative; a length is needed"},
      {std::string("\x7f"
                   "ELF\0\1\2\n\xff\xfe",
                   10),
       "b.wif:1: \"?ELF???\" stands before the first [SECTION]; a WIF file begins with [WIF]"},
  };
  for (const Broken& broken : table) {
    try {
      (void)read_wif(broken.text, "b.wif");
      ADD_FAILURE() << "accepted; expected " << broken.message;
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
      EXPECT_EQ(error.what(), broken.message);
    }
  }
}

TEST(Wif, EveryTruncationIsReadOrRefused) {
  const std::string text = twill();
  for (std::size_t size = 0; size < text.size(); ++size) {
    try {
      const WifDraft draft = read_wif(text.substr(0, size), "cut.wif");
      EXPECT_EQ(draft.up.size(), std::size_t{draft.warp.count} * draft.weft.count);
    } catch (const core::Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("cut.wif:"));
    }
  }
}

struct Expected {
  const char* file;
  std::uint32_t ends, picks;                // as drawn
  std::uint32_t repeat_ends, repeat_picks;  // by the two roles alone
};

TEST(Wif, RealDraftsLoad) {
  const char* data = std::getenv("WEFT_SHARED_DATA");
  if (data == nullptr || !std::filesystem::exists(std::string(data) + "/wif")) {
    GTEST_SKIP() << "WEFT_SHARED_DATA does not name a folder with wif/";
  }
  for (const Expected& expected : {Expected{"16.wif", 32, 32, 8, 8},
                                   {"2202.wif", 24, 24, 4, 6},
                                   {"2parallel.wif", 3, 2, 3, 2},
                                   {"3parallellwarps.wif", 3, 3, 1, 3},
                                   {"54235plain.wif", 2, 2, 2, 2},
                                   {"8452.wif", 84, 100, 28, 50},
                                   {"Overshot_Honeysuckle.wif", 91, 480, 91, 60},
                                   {"hearts3.wif", 31, 40, 31, 40},
                                   {"two_color_liftplan.wif", 4, 6, 4, 6},
                                   {"two_color_single_treadles.wif", 4, 6, 4, 6}}) {
    const std::string path = std::string(data) + "/wif/" + expected.file;
    const std::string text = core::read_file(path);
    const WifDraft wif = read_wif(text, expected.file);
    EXPECT_EQ(wif.warp.count, expected.ends) << expected.file;
    EXPECT_EQ(wif.weft.count, expected.picks) << expected.file;
    v1::Weave weave;
    weave.set_wif_text(text);
    weave.set_warp_yarn("warp");
    weave.set_weft_yarn("weft");
    const Draft draft = draft_of(weave);
    EXPECT_EQ(draft.ends, expected.repeat_ends) << expected.file;
    EXPECT_EQ(draft.picks, expected.repeat_picks) << expected.file;
  }
}

}  // namespace
}  // namespace weft::fabric
