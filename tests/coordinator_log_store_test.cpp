#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "coordinator/scheduler/log_store.h"
#include "core/error.h"

namespace weft::coordinator {
namespace {

namespace fs = std::filesystem;

class LogStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "weft_logs_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }

  static LogLimits small() {
    LogLimits limits;
    limits.attempt_bytes = 1000;
    limits.job_bytes = 4000;
    limits.total_bytes = 8000;
    limits.block_bytes = 100;
    return limits;
  }
  static std::string all_of(const LogStore& store, const std::string& job, std::uint64_t attempt) {
    std::string text;
    std::uint64_t offset = 0;
    while (true) {
      const LogStore::Part part = store.read(job, attempt, offset, 64);
      if (part.text.empty()) {
        return text;
      }
      EXPECT_GT(part.next, offset);
      text += part.text;
      offset = part.next;
    }
  }

  fs::path folder_;
};

TEST_F(LogStoreTest, KeepsWhatItIsGivenOnceAndInOrder) {
  LogStore store(folder_ / "logs");
  EXPECT_EQ(store.append("j1", 7, 0, "one\n"), 4U);
  EXPECT_EQ(store.append("j1", 7, 0, "one\n"), 4U) << "a repeated call changes nothing";
  EXPECT_EQ(store.append("j1", 7, 2, "e\ntwo\n"), 8U) << "only what is new is added";
  EXPECT_EQ(store.append("j1", 7, 9, "far\n"), std::nullopt);
  EXPECT_EQ(store.append("j1", 7, 0, ""), 8U) << "an empty call asks how much there is";
  EXPECT_EQ(all_of(store, "j1", 7), "one\ntwo\n");
  EXPECT_EQ(store.size("j1", 7), 8U);
  EXPECT_EQ(store.size("j1", 8), 0U);
  EXPECT_EQ(all_of(store, "j2", 7), "");
}

TEST_F(LogStoreTest, ALongLogLosesItsMiddleAndSaysHowMuch) {
  LogStore store(folder_, small());
  std::string all;
  for (int i = 0; i < 500; ++i) {
    const std::string line = fmt::format("line {}\n", i);
    const std::uint64_t offset = all.size();
    all.append(line);
    EXPECT_EQ(store.append("j1", 1, offset, line), all.size());
  }
  const std::string kept = all_of(store, "j1", 1);
  EXPECT_LT(kept.size(), 1100U);
  EXPECT_LT(fs::file_size(folder_ / "j1" / "1.log"), 1100U);
  EXPECT_TRUE(kept.starts_with("line 0\nline 1\n")) << kept;
  EXPECT_TRUE(kept.ends_with("line 498\nline 499\n")) << kept;
  const std::size_t gap = kept.find("[... ");
  ASSERT_NE(gap, std::string::npos) << kept;
  const std::uint64_t dropped = std::stoull(kept.substr(gap + 5));
  const std::size_t marker = kept.find('\n', gap) + 1 - gap;
  EXPECT_EQ(dropped + kept.size() - marker, all.size()) << "every byte is kept or counted";
  EXPECT_EQ(kept[gap - 1], '\n') << "only whole lines are dropped";
}

TEST_F(LogStoreTest, WhatAnEarlierProcessWroteIsThereAndGoesOn) {
  std::string before;
  std::uint64_t size = 0;
  {
    LogStore store(folder_, small());
    for (int i = 0; i < 200; ++i) {
      size = *store.append("j1", 1, size, fmt::format("line {}\n", i));
    }
    store.append("j1", 2, 0, "short\n");
    before = all_of(store, "j1", 1);
  }
  std::ofstream(folder_ / "j1" / "1.log.part") << "half";
  LogStore store(folder_, small());
  EXPECT_EQ(store.attempts("j1"), (std::vector<std::uint64_t>{1, 2}));
  EXPECT_EQ(store.size("j1", 1), size);
  EXPECT_EQ(all_of(store, "j1", 1), before);
  EXPECT_EQ(store.append("j1", 1, size, "more\n"), size + 5);
  EXPECT_TRUE(all_of(store, "j1", 1).ends_with("more\n"));
  EXPECT_FALSE(fs::exists(folder_ / "j1" / "1.log.part"));
}

TEST_F(LogStoreTest, ADamagedFileBeginsAgain) {
  fs::create_directories(folder_ / "j1");
  for (const std::string& content :
       {std::string(), std::string("no header"), std::string("weft-log 1 \n"),
        std::string("weft-log 1 900 7\nshort\n"), std::string("weft-log 1 0 0")}) {
    std::ofstream(folder_ / "j1" / "1.log") << content;
    LogStore store(folder_, small());
    EXPECT_EQ(store.size("j1", 1), 0U) << content;
    EXPECT_EQ(store.append("j1", 1, 0, "new\n"), 4U) << content;
    EXPECT_EQ(all_of(store, "j1", 1), "new\n") << content;
  }
}

TEST_F(LogStoreTest, AJobBeyondItsLimitLosesItsOldestAttempts) {
  LogStore store(folder_, small());
  for (std::uint64_t attempt = 1; attempt <= 100; ++attempt) {
    store.append("j1", attempt, 0, std::string(90, 'x') + "\n");
  }
  const std::vector<std::uint64_t> kept = store.attempts("j1");
  EXPECT_LE(kept.size(), 20U);
  EXPECT_GE(kept.size(), 15U);
  EXPECT_EQ(kept.back(), 100U);
  std::size_t files = 0;
  for (const auto& item : fs::directory_iterator(folder_ / "j1")) {
    files += item.is_regular_file() ? 1 : 0;
  }
  EXPECT_EQ(files, kept.size());
}

TEST_F(LogStoreTest, BeyondTheLimitOfAllTheJobsThatWroteLeastRecentlyLoseTheirs) {
  {
    LogStore store(folder_, small());
    for (int job = 1; job <= 4; ++job) {
      for (std::uint64_t attempt = 1; attempt <= 10; ++attempt) {
        store.append(fmt::format("j{}", job), attempt, 0, std::string(80, 'x') + "\n");
      }
    }
    store.append("j1", 11, 0, "it still runs\n");
  }
  LogStore store(folder_, small());
  for (std::uint64_t attempt = 1; attempt <= 18; ++attempt) {
    store.append("j5", attempt, 0, std::string(180, 'x') + "\n");
    store.append("j6", attempt, 0, std::string(180, 'x') + "\n");
  }
  EXPECT_TRUE(store.attempts("j2").empty());
  EXPECT_FALSE(fs::exists(folder_ / "j2"));
  EXPECT_FALSE(store.attempts("j5").empty());
  EXPECT_EQ(store.attempts("j6").back(), 18U);
}

TEST_F(LogStoreTest, ANameThatIsNotAJobsIsRefused) {
  LogStore store(folder_ / "logs");
  for (const char* const name : {"", "../up", "a/b", ".", "..", "a b"}) {
    EXPECT_THROW((void)store.append(name, 1, 0, "x\n"), core::Error) << name;
  }
  EXPECT_TRUE(fs::is_empty(folder_ / "logs"));
}

TEST_F(LogStoreTest, AChangeIsToldByTheRevision) {
  LogStore store(folder_);
  const std::uint64_t before = store.revision("j1");
  store.append("j1", 1, 0, "x\n");
  EXPECT_NE(store.revision("j1"), before);
  store.wait_for_change("j1", before, std::chrono::hours(1));
  EXPECT_EQ(store.revision("j2"), before);
}

}  // namespace
}  // namespace weft::coordinator
