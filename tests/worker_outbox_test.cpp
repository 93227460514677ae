#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "worker/outbox.h"

namespace weft::worker {
namespace {

OutboxItem item_of(const std::string& bytes) { return {{}, core::digest_of(bytes), bytes}; }

TEST(Outbox, GivesItemsInTheOrderTheyCame) {
  Outbox outbox(1000);
  EXPECT_TRUE(outbox.push(item_of("a")));
  EXPECT_TRUE(outbox.push(item_of("b")));
  EXPECT_EQ(outbox.pop()->bytes, "a");
  EXPECT_EQ(outbox.pop()->bytes, "b");
}

TEST(Outbox, AFullOneMakesTheNextWaitUntilThereIsRoom) {
  Outbox outbox(10);
  EXPECT_TRUE(outbox.push(item_of(std::string(20, 'x'))));
  std::atomic<bool> is_in{false};
  std::jthread second([&] {
    EXPECT_TRUE(outbox.push(item_of("y")));
    is_in.store(true);
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_FALSE(is_in.load()) << "it went in although the outbox was full";
  EXPECT_EQ(outbox.pop()->bytes.size(), 20U);
  second.join();
  EXPECT_EQ(outbox.pop()->bytes, "y");
}

TEST(Outbox, AClosedOneGivesWhatItHoldsAndTakesNothing) {
  Outbox outbox(1000);
  EXPECT_TRUE(outbox.push(item_of("a")));
  outbox.close();
  EXPECT_FALSE(outbox.push(item_of("b")));
  EXPECT_EQ(outbox.pop()->bytes, "a");
  EXPECT_FALSE(outbox.pop());
}

}  // namespace
}  // namespace weft::worker
