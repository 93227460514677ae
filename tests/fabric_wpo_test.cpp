#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "fabric/wpo.h"

namespace weft::fabric {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Writes such files as the layout in wpo.h says, which is all that is known of them.
struct WpoText {
  int version = 7;
  int kind = 101;
  int shafts = 4;
  int treadles = 4;
  bool rising = true;
  std::vector<int> threading = {1, 2, 3, 4};
  std::vector<int> warp_colours = {1, 1, 2, 2};
  std::vector<int> weft_colours = {0, 0, 0, 0};
  std::string moved;  // tie-up and treadling, or the lift plan
  std::vector<std::vector<int>> palette = {{255, 255, 255}, {255, 0, 0}, {0, 0, 51}};

  static void add(std::string& bytes, int value) { bytes += static_cast<char>(value); }
  static std::string counted(const std::vector<int>& values) {
    std::string bytes;
    add(bytes, static_cast<int>(values.size()) >> 8);
    add(bytes, static_cast<int>(values.size()) & 255);
    for (const int value : values) {
      add(bytes, value);
    }
    return bytes;
  }
  [[nodiscard]] std::string bytes() const {
    std::string bytes;
    for (const int value : {123, version, kind, 4, shafts, treadles, 0, rising ? 0 : 1, 0, 20, 10,
                            0, 0, 4, 0xb0, 4, 0xb0}) {  // a page of 1,200 threads each way
      add(bytes, value);
    }
    bytes.append(7, '\0');
    bytes += counted(threading) + counted(warp_colours) + counted(weft_colours) + moved;
    bytes.append(66, '\0');
    add(bytes, static_cast<int>(palette.size()));
    for (const std::vector<int>& colour : palette) {
      for (const int value : colour) {
        add(bytes, value);
      }
    }
    return bytes;
  }
};

WpoText twill() {
  WpoText text;
  text.moved = std::string("\x03\x06\x0c\x09") + WpoText::counted({1, 2, 3, 4});
  return text;
}

std::vector<std::string> rows(const WifDraft& draft) {
  std::vector<std::string> result(draft.weft.count);
  for (std::size_t i = 0; i < draft.up.size(); ++i) {
    result[i / draft.warp.count] += draft.up[i] != 0 ? 'X' : '.';
  }
  return result;
}

TEST(Wpo, ReadsATieUpWithOneTreadleAPick) {
  const WifDraft draft = read_wpo(twill().bytes(), "t.wpo");
  EXPECT_THAT(rows(draft), ElementsAre("XX..", ".XX.", "..XX", "X..X"));
  EXPECT_THAT(draft.warp.colours, ElementsAre(2, 2, 3, 3));
  EXPECT_THAT(draft.weft.colours, ElementsAre(1, 1, 1, 1));
  EXPECT_DOUBLE_EQ(draft.colours.at(3)[2], 0.2);
  EXPECT_DOUBLE_EQ(draft.warp.spacing_mm, 1.27);
  EXPECT_DOUBLE_EQ(draft.weft.spacing_mm, 2.54);
  EXPECT_THAT(draft.notes, ElementsAre(HasSubstr("thickness of single threads are not read")));
}

TEST(Wpo, ReadsSeveralTreadlesAPickAndSinkingSheds) {
  WpoText text = twill();
  text.kind = 102;
  text.rising = false;
  text.moved = std::string("\x03\x06\x0c\x09") + WpoText::counted({3, 6, 12, 9});
  EXPECT_THAT(rows(read_wpo(text.bytes(), "t.wpo")), ElementsAre("...X", "X...", ".X..", "..X."));
}

TEST(Wpo, RowsOfMoreThanEightShaftsTakeTwoBytesTheLowFirst) {
  WpoText text = twill();
  text.kind = 100;
  text.shafts = 10;
  text.threading = {1, 9, 10, 0};
  text.moved = std::string("\x00\x02\x01\x02\x00\x01", 6);  // shafts 1 and 10; shaft 9
  text.weft_colours = {0, 2};
  EXPECT_THAT(rows(read_wpo(text.bytes(), "t.wpo")), ElementsAre("X.X.", ".X.."));
}

TEST(Wpo, OlderFilesHaveCoarserColours) {
  WpoText text = twill();
  text.version = 3;
  text.palette = {{63, 0, 0}, {21, 63, 0}, {0, 0, 0}};
  const WifDraft draft = read_wpo(text.bytes(), "t.wpo");
  EXPECT_DOUBLE_EQ(draft.colours.at(1)[0], 1);
  EXPECT_DOUBLE_EQ(draft.colours.at(2)[0], 21.0 / 63);
}

TEST(Wpo, AThreadWithoutAColourTakesTheLastAndANoteSaysSo) {
  WpoText text = twill();
  text.warp_colours = {1};
  text.weft_colours = {7, 0, 0, 0};
  const WifDraft draft = read_wpo(text.bytes(), "t.wpo");
  EXPECT_THAT(draft.warp.colours, ElementsAre(2, 2, 2, 2));
  EXPECT_THAT(draft.weft.colours, ElementsAre(3, 1, 1, 1));
  EXPECT_THAT(draft.notes, ::testing::Contains(HasSubstr("the last one goes on")));
  EXPECT_THAT(draft.notes, ::testing::Contains(HasSubstr("beyond the palette's 3")));
}

TEST(Wpo, EveryMistakeNamesItsByte) {
  const auto message = [](const std::string& bytes) -> std::string {
    try {
      (void)read_wpo(bytes, "w.wpo");
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
      return error.what();
    }
    return "nothing was wrong";
  };
  WpoText text = twill();
  EXPECT_THAT(message("hello"),
              HasSubstr("w.wpo: byte 1: the file does not begin as a WeavePoint"));
  text.kind = 99;
  EXPECT_THAT(message(text.bytes()), HasSubstr("byte 3: the draft is of kind 99"));
  text = twill();
  text.threading = {1, 2, 3, 5};
  EXPECT_THAT(message(text.bytes()), HasSubstr("the threading names number 5, there are 4"));
  text = twill();
  text.moved = std::string("\x03\x06\x0c\x19") + WpoText::counted({1, 2, 3, 4});
  EXPECT_THAT(message(text.bytes()), HasSubstr("the tie-up names number 5, there are 4"));
  text = twill();
  text.threading.clear();
  EXPECT_THAT(message(text.bytes()), HasSubstr("0 ends and 4 picks"));
  const std::string whole = twill().bytes();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THAT(message(whole.substr(0, size)), HasSubstr("the file ends within"));
  }
}

}  // namespace
}  // namespace weft::fabric
