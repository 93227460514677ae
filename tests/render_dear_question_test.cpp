#include <atomic>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "render/node/dear_question.h"

namespace weft::render {
namespace {

TEST(DearQuestion, IsPassedOnSeldomThoughAskedOften) {
  std::atomic<int> passed_on = 0;
  DearQuestion question([&] {
    ++passed_on;
    return false;
  });
  constexpr int kAsked = 100'000;
  std::vector<std::thread> askers;
  for (int i = 0; i < 4; ++i) {
    askers.emplace_back([&] {
      for (int asked = 0; asked < kAsked; ++asked) {
        EXPECT_FALSE(question());
      }
    });
  }
  for (std::thread& asker : askers) {
    asker.join();
  }
  EXPECT_GE(passed_on, 1);
  EXPECT_LT(passed_on, kAsked);
}

TEST(DearQuestion, HearsOfAYesAndKeepsToIt) {
  std::atomic<bool> answer = false;
  std::atomic<int> yeses = 0;
  DearQuestion question([&] {
    yeses += answer ? 1 : 0;
    return answer.load();
  });
  EXPECT_FALSE(question());
  answer = true;
  while (!question()) {
    std::this_thread::yield();
  }
  answer = false;
  EXPECT_TRUE(question());
  EXPECT_EQ(yeses, 1);
}

}  // namespace
}  // namespace weft::render
