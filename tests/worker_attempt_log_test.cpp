#include <chrono>
#include <string>

#include <gtest/gtest.h>

#include "proto/limits.h"
#include "worker/attempt_log.h"

namespace weft::worker {
namespace {

class ManualClock final : public core::Clock {
 public:
  [[nodiscard]] Time now() const override { return now_; }
  void advance(std::chrono::milliseconds time) { now_ += time; }

 private:
  Time now_{std::chrono::milliseconds(1'700'000'000'123)};
};

class AttemptLogTest : public testing::Test {
 protected:
  ManualClock clock_;
  AttemptLog log_{clock_};
};

TEST_F(AttemptLogTest, ALineHasItsTimeAndIsTheLastLine) {
  EXPECT_EQ(log_.last_line(), "");
  log_.add("shard 3\ndone \x01\xff in grün");
  EXPECT_EQ(log_.next_piece().text, "2023-11-14T22:13:20.123Z shard 3 done  ? in grün\n");
  EXPECT_EQ(log_.last_line(), "shard 3 done  ? in grün");
}

TEST_F(AttemptLogTest, WhatHasArrivedIsNotSentAgainAndOffsetsGoOn) {
  log_.add("one");
  const AttemptLog::Piece first = log_.next_piece();
  log_.add("two");
  log_.arrived(first.text.size());
  const AttemptLog::Piece second = log_.next_piece();
  EXPECT_EQ(second.offset, first.text.size());
  EXPECT_NE(second.text.find("two"), std::string::npos);
  EXPECT_EQ(second.text.find("one"), std::string::npos);
  log_.arrived(second.offset + second.text.size());
  EXPECT_FALSE(log_.has_more());
}

TEST_F(AttemptLogTest, GoesOnWhereACoordinatorIsThatLostTheEnd) {
  log_.add("one");
  log_.arrived(log_.next_piece().text.size());
  log_.add("two");
  const std::string text = log_.next_piece().text;
  log_.arrived(5);
  EXPECT_EQ(log_.next_piece().offset, 5U);
  EXPECT_EQ(log_.next_piece().text, text);
}

TEST_F(AttemptLogTest, APieceIsNoLargerThanAMessageMayHold) {
  for (int i = 0; i < 100; ++i) {
    log_.add(std::string(900, 'x'));
  }
  EXPECT_EQ(log_.next_piece().text.size(), v1::kLogChunkLimitBytes);
}

TEST_F(AttemptLogTest, MemoryIsBoundedAndWhatIsMissingIsCountedAndErrorsHaveRoom) {
  for (int i = 0; i < 1000; ++i) {
    log_.add(std::string(1000, 'x'));
  }
  log_.add_important("error: it went wrong");
  EXPECT_EQ(log_.last_line(), "error: it went wrong");
  std::string all;
  while (log_.has_more()) {
    const AttemptLog::Piece piece = log_.next_piece();
    all += piece.text;
    log_.arrived(piece.offset + piece.text.size());
  }
  EXPECT_LT(all.size(), 200'000U);
  EXPECT_NE(all.find("lines were dropped here"), std::string::npos);
  EXPECT_NE(all.find("error: it went wrong"), std::string::npos);
}

TEST_F(AttemptLogTest, RoutineLinesComeOnceASecondButTheLastOneIsKnown) {
  for (int i = 0; i < 25; ++i) {
    log_.add_sometimes("shard " + std::to_string(i));
    clock_.advance(std::chrono::milliseconds(100));
  }
  EXPECT_EQ(log_.last_line(), "shard 24");
  const std::string text = log_.next_piece().text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 3) << text;
}

TEST(AttemptLogText, IsCutBetweenCharacters) {
  EXPECT_EQ(beginning_of("grün", 3), "gr");
  EXPECT_EQ(beginning_of("grün", 4), "grü");
  EXPECT_EQ(beginning_of("grün", 9), "grün");
  EXPECT_EQ(printable("\xed\xa0\x80 \xc0\xaf \xf5"), "??? ?? ?");
}

}  // namespace
}  // namespace weft::worker
