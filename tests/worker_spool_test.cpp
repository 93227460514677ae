#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "core/error.h"
#include "core/file.h"
#include "proto/limits.h"
#include "worker/spool.h"

namespace weft::worker {
namespace {

namespace fs = std::filesystem;

bool never() { return false; }

class SpoolTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "weft_spool_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    root_ = name;
  }
  void TearDown() override { fs::remove_all(root_); }

  static ShardClaim claim_of(std::uint64_t attempt, std::uint64_t shard) {
    ShardClaim claim{std::make_shared<Attempt>(), shard};
    claim.attempt->assignment.mutable_name()->set_job_id("j1");
    claim.attempt->assignment.mutable_name()->set_attempt(attempt);
    claim.attempt->assignment.set_lease_token("token" + std::to_string(attempt));
    return claim;
  }
  static bool put(Spool& spool, const ShardClaim& claim, const std::string& bytes) {
    return spool.put(claim, core::digest_of(bytes), bytes, never);
  }
  // How many entries there are in all folders of the root.
  [[nodiscard]] std::size_t count(const std::string& part) const {
    std::size_t count = 0;
    for (const auto& item : fs::recursive_directory_iterator(root_)) {
      count += item.path().filename().string().find(part) != std::string::npos ? 1 : 0;
    }
    return count;
  }

  fs::path root_;
};

// As a process leaves it that is killed: the lock goes, the files stay.
std::vector<SpoolFolder::Content> content_of(const fs::path& root) {
  std::vector<SpoolFolder::Content> all;
  for (const SpoolFolder& folder : SpoolFolder::claim_orphans(root)) {
    for (SpoolFolder::Content& content : folder.load()) {
      all.push_back(std::move(content));
    }
  }
  return all;
}

TEST_F(SpoolTest, GivesResultsInTheOrderTheyCameAndKeepsTheirNamesUntilForgotten) {
  Spool spool(root_, "w1", 1000);
  ASSERT_TRUE(put(spool, claim_of(7, 3), "three"));
  ASSERT_TRUE(put(spool, claim_of(7, 4), "four"));
  const std::vector<SpoolItem> both = spool.next();
  ASSERT_EQ(both.size(), 2U);
  EXPECT_EQ(both[0].claim.shard, 3U);
  EXPECT_EQ(Spool::read(both[0]), "three");
  spool.uploaded(both[0]);
  EXPECT_EQ(count(core::digest_of("three").hex()), 0U) << "the coordinator has the bytes";
  EXPECT_EQ(count(".attempt"), 1U);
  EXPECT_EQ(Spool::read(both[1]), "four");
  spool.uploaded(both[1]);
  spool.forget(both[0].claim.attempt->assignment.name());
  EXPECT_EQ(count(".attempt"), 0U);
}

TEST_F(SpoolTest, ResultsThatAreTooLargeToGoTogetherGoOneAfterTheOther) {
  Spool spool(root_, "w1", 1 << 24);
  const std::size_t most = v1::kChunkLimitBytes;
  for (const std::size_t size : {most / 2, most / 2, std::size_t{1}, 3 * most, std::size_t{1}}) {
    ASSERT_TRUE(put(spool, claim_of(1, size), std::string(size, 'x')));
  }
  std::vector<std::size_t> sizes;
  while (sizes.size() < 4) {
    sizes.push_back(spool.next().size());
  }
  EXPECT_EQ(sizes, (std::vector<std::size_t>{2, 1, 1, 1}));
}

TEST_F(SpoolTest, WhatADeadProcessLeftIsTakenOverWithItsTokenAndItsResults) {
  {
    // Not a Spool: a process that is killed cleans nothing up.
    const SpoolFolder dead = SpoolFolder::make(root_, "dead");
    v1::Completion name;
    name.set_job_id("j1");
    name.set_attempt(9);
    name.set_lease_token(std::string("to\0ken", 6));
    dead.append(1, name);
    v1::Completion stored;
    stored.add_results()->set_shard(5);
    dead.append(1, stored);
    dead.write(1, {6, core::digest_of("six"), 3}, "six");
    EXPECT_TRUE(SpoolFolder::claim_orphans(root_).empty()) << "its process lives";
  }
  Spool spool(root_, "w2", 1000);
  const std::vector<Spool::Orphan> orphans = spool.take_over();
  ASSERT_EQ(orphans.size(), 1U);
  EXPECT_EQ(orphans[0].completion.attempt(), 9U);
  EXPECT_EQ(orphans[0].completion.lease_token(), std::string("to\0ken", 6));
  ASSERT_EQ(orphans[0].completion.results_size(), 1);
  EXPECT_EQ(orphans[0].completion.results(0).shard(), 5U);
  ASSERT_EQ(orphans[0].items.size(), 1U);
  EXPECT_EQ(Spool::read(orphans[0].items[0]), "six");
  EXPECT_TRUE(spool.take_over().empty()) << "they are taken over once";
  EXPECT_TRUE(SpoolFolder::claim_orphans(root_).empty()) << "nobody else may have them now";
  SpoolItem item = orphans[0].items[0];
  item.claim = claim_of(9, 6);
  spool.enter(item);
  spool.uploaded(spool.next().at(0));
  spool.forget(item.claim.attempt->assignment.name());
  EXPECT_FALSE(fs::exists(root_ / "dead"));
}

TEST_F(SpoolTest, ATornEndOfAnAttemptsFileIsLeftOut) {
  fs::path file;
  {
    const SpoolFolder folder = SpoolFolder::make(root_, "w1");
    v1::Completion name;
    name.set_job_id("j1");
    name.set_attempt(1);
    folder.append(4, name);
    for (std::uint64_t shard = 0; shard < 3; ++shard) {
      v1::Completion stored;
      stored.add_results()->set_shard(shard);
      folder.append(4, stored);
    }
    file = folder.path() / "4.attempt";
  }
  const std::string whole = core::read_file(file);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    core::write_file_atomically(file, whole.substr(0, size));
    const std::vector<SpoolFolder::Content> content = content_of(root_);
    if (content.empty()) {  // not even its name was left
      EXPECT_LT(size, whole.size() / 2);
      core::write_file_atomically(file, whole);
      continue;
    }
    ASSERT_EQ(content.size(), 1U);
    EXPECT_EQ(content[0].completion.attempt(), 1U);
    EXPECT_LT(content[0].completion.results_size(), 3);
  }
  core::write_file_atomically(file, whole);
  ASSERT_EQ(content_of(root_).size(), 1U);
  EXPECT_EQ(content_of(root_)[0].completion.results_size(), 3);
}

TEST_F(SpoolTest, ADamagedResultIsNotRead) {
  Spool spool(root_, "w1", 1000);
  ASSERT_TRUE(put(spool, claim_of(1, 0), "good bytes"));
  const SpoolItem item = spool.next().at(0);
  const fs::path file = item.folder->path() / ("1.0." + core::digest_of("good bytes").hex());
  std::ofstream(file) << "good byteZ";
  EXPECT_THROW((void)Spool::read(item), core::Error);
  spool.dropped(item);
  EXPECT_FALSE(fs::exists(file));
}

TEST_F(SpoolTest, AFullOneMakesTheNextWaitUntilThereIsRoomOrItIsToStop) {
  Spool spool(root_, "w1", 10);
  ASSERT_TRUE(put(spool, claim_of(1, 0), std::string(20, 'x')));
  EXPECT_FALSE(spool.put(claim_of(1, 1), core::digest_of("y"), "y", [] { return true; }));
  std::atomic<bool> is_in{false};
  std::jthread second([&] {
    EXPECT_TRUE(put(spool, claim_of(1, 2), "z"));
    is_in.store(true);
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(is_in.load()) << "it went in although the spool was full";
  spool.uploaded(spool.next().at(0));
  second.join();
  EXPECT_EQ(Spool::read(spool.next().at(0)), "z");
}

TEST_F(SpoolTest, AClosedOneKeepsItsResultsForASuccessor) {
  {
    Spool spool(root_, "w1", 1000);
    ASSERT_TRUE(put(spool, claim_of(1, 0), "a"));
    spool.close();
    EXPECT_FALSE(put(spool, claim_of(1, 1), "b"));
    EXPECT_TRUE(spool.next().empty());
  }
  const std::vector<SpoolFolder::Content> content = content_of(root_);
  ASSERT_EQ(content.size(), 1U);
  ASSERT_EQ(content[0].results.size(), 1U);
  EXPECT_EQ(content[0].results[0].digest, core::digest_of("a"));
}

TEST_F(SpoolTest, AnEmptyOneLeavesNothingBehind) {
  {
    Spool spool(root_, "w1", 1000);
    const ShardClaim claim = claim_of(1, 0);
    ASSERT_TRUE(put(spool, claim, "a"));
    spool.uploaded(spool.next().at(0));
    spool.forget(claim.attempt->assignment.name());
  }
  EXPECT_TRUE(fs::is_empty(root_));
}

TEST_F(SpoolTest, AFullDiskIsAShortResourceAndLeavesNoHalfResult) {
  Spool spool(root_, "w1", 1 << 20);
  ASSERT_TRUE(put(spool, claim_of(1, 0), "small"));
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto ignored = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 4096;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  core::Code code = core::Code::kInternal;
  std::string message;
  try {
    put(spool, claim_of(1, 1), std::string(10'000, 'x'));
  } catch (const core::Error& error) {
    code = error.code();
    message = error.what();
  }
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  static_cast<void>(std::signal(SIGXFSZ, ignored));
  EXPECT_EQ(code, core::Code::kResourceExhausted) << message;
  EXPECT_NE(message.find("--scratch"), std::string::npos) << message;
  EXPECT_EQ(count("1.1."), 0U);
  EXPECT_TRUE(put(spool, claim_of(1, 1), std::string(10'000, 'x'))) << "there is room again";
  EXPECT_EQ(Spool::read(spool.next().at(0)), "small");
}

TEST_F(SpoolTest, RemainsOfAFolderThatWasBeingRemovedAreRemoved) {
  fs::create_directories(root_ / "w1.discarded");
  std::ofstream(root_ / "w1.discarded" / "1.attempt") << "x";
  fs::create_directories(root_ / "w2.making");
  EXPECT_TRUE(SpoolFolder::claim_orphans(root_).empty());
  EXPECT_FALSE(fs::exists(root_ / "w1.discarded"));
  EXPECT_TRUE(fs::exists(root_ / "w2.making")) << "its process may be about to lock it";
}

}  // namespace
}  // namespace weft::worker
