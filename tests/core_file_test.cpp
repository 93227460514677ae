#include <atomic>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/file.h"

namespace weft::core {
namespace {

using testing::HasSubstr;

class FileTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] long entries() const {
    const std::filesystem::directory_iterator all(folder_);
    return std::distance(begin(all), end(all));
  }

  template <class Function>
  static Code code_of(Function function) {
    try {
      function();
    } catch (const Error& error) {
      return error.code();
    }
    return Code::kInternal;
  }

  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("weft_file_") + testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::path path_ = folder_ / "file";
};

TEST_F(FileTest, ReadsWhatWasWritten) {
  std::string data(200'000, '\0');
  for (std::size_t i = 0; i < data.size(); ++i) {
    data[i] = static_cast<char>(i * 7);
  }
  write_file_atomically(path_, data);
  EXPECT_EQ(read_file(path_), data);
  write_file_atomically(path_, "");
  EXPECT_EQ(read_file(path_), "");
  EXPECT_EQ(entries(), 1);
}

TEST_F(FileTest, ReadsFilesThatDoNotTellTheirLength) {
  ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
  const std::string data(200'000, 'x');
  const std::jthread writer([&] { write_file_unsynced(path_, data); });
  EXPECT_EQ(read_file(path_), data);
  EXPECT_THAT(read_file("/proc/self/status"), HasSubstr("Name:"));
  EXPECT_EQ(code_of([] { (void)read_file("/proc/self/status", 10); }), Code::kResourceExhausted);
}

TEST_F(FileTest, WhatIsWrittenUnsyncedIsReadAndPublished) {
  write_file_unsynced(folder_ / "beside", "longer than what follows");
  write_file_unsynced(folder_ / "beside", "new");
  publish_file(folder_ / "beside", path_);
  EXPECT_EQ(read_file(path_), "new");
  EXPECT_EQ(entries(), 1);
  EXPECT_EQ(code_of([this] { write_file_unsynced(folder_ / "absent" / "file", "x"); }),
            Code::kUnavailable);
}

TEST_F(FileTest, MissingFileAndFolderAreNotFound) {
  EXPECT_EQ(code_of([this] { (void)read_file(path_); }), Code::kNotFound);
  EXPECT_EQ(code_of([this] { (void)read_file(folder_); }), Code::kNotFound);
}

TEST_F(FileTest, FileOverTheLimitIsRefused) {
  write_file_atomically(path_, std::string(1000, 'x'));
  EXPECT_EQ(read_file(path_, 1000).size(), 1000U);
  EXPECT_EQ(code_of([this] { (void)read_file(path_, 999); }), Code::kResourceExhausted);
}

TEST_F(FileTest, WritingIntoAMissingFolderNamesThePath) {
  try {
    write_file_atomically(folder_ / "absent" / "file", "x");
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), Code::kUnavailable);
    EXPECT_THAT(error.what(), HasSubstr("absent/file"));
  }
}

// The file system takes only so many bytes: the old file stays whole and nothing lies beside it.
TEST_F(FileTest, OldFileSurvivesAFullDisk) {
  write_file_atomically(path_, "old");
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const rlimit limit{10'000, 10'000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    ::signal(SIGXFSZ, SIG_IGN);
    const Code code = code_of([this] { write_file_atomically(path_, std::string(1 << 20, 'x')); });
    ::_exit(code == Code::kUnavailable ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_EQ(read_file(path_), "old");
  EXPECT_EQ(entries(), 1);
}

TEST_F(FileTest, ReadersSeeTheOldFileOrTheNewOne) {
  const std::string old_data(100'000, 'o');
  const std::string new_data(150'000, 'n');
  write_file_atomically(path_, old_data);
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (int i = 0; i < 40; ++i) {
      write_file_atomically(path_, i % 2 == 0 ? new_data : old_data);
    }
    done = true;
  });
  std::size_t torn = 0;
  while (!done) {
    const std::string data = read_file(path_);
    torn += data == old_data || data == new_data ? 0 : 1;
  }
  writer.join();
  EXPECT_EQ(torn, 0U);
}

TEST_F(FileTest, WritersOfTheSameFileDoNotMix) {
  std::vector<std::thread> writers;
  for (char letter = 'a'; letter < 'e'; ++letter) {
    writers.emplace_back([this, letter] {
      for (int i = 0; i < 10; ++i) {
        write_file_atomically(path_, std::string(50'000, letter));
      }
    });
  }
  for (std::thread& writer : writers) {
    writer.join();
  }
  const std::string data = read_file(path_);
  EXPECT_EQ(data, std::string(50'000, data[0]));
  EXPECT_EQ(entries(), 1);
}

TEST_F(FileTest, PublishingMovesAFile) {
  write_file_atomically(folder_ / "beside", "new");
  write_file_atomically(path_, "old");
  publish_file(folder_ / "beside", path_);
  EXPECT_EQ(read_file(path_), "new");
  EXPECT_EQ(entries(), 1);
  EXPECT_EQ(code_of([this] { publish_file(folder_ / "absent", path_); }), Code::kUnavailable);
  EXPECT_EQ(read_file(path_), "new");
}

}  // namespace
}  // namespace weft::core
