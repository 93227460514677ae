#include <filesystem>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "core/file_batch.h"
#include "core/file_fault.h"

namespace weft::core {
namespace {

class FileBatchTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override {
    set_file_fault_hook(nullptr);
    std::filesystem::remove_all(folder_);
  }

  // What stands under final names.
  [[nodiscard]] std::map<std::string, std::string> files() const {
    std::map<std::string, std::string> found;
    for (const auto& item : std::filesystem::directory_iterator(folder_)) {
      if (item.is_regular_file()) {
        found[item.path().filename().string()] = read_file(item.path());
      }
    }
    return found;
  }

  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("weft_batch_") + testing::UnitTest::GetInstance()->current_test_info()->name());
  const std::map<std::string, std::string> whole_{
      {"a", std::string(5000, 'a')}, {"b", std::string(300'000, 'b')}, {"c", ""}};
};

TEST_F(FileBatchTest, FilesHaveTheirNamesAfterTheCommit) {
  {
    FileBatch batch(folder_ / "beside");
    for (const auto& [name, data] : whole_) {
      batch.write(folder_ / name, data);
    }
    EXPECT_TRUE(files().empty());
    batch.commit();
    EXPECT_EQ(files(), whole_);
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "beside"));
}

TEST_F(FileBatchTest, WithoutACommitNothingIsLeft) {
  {
    FileBatch batch(folder_ / "beside");
    batch.write(folder_ / "a", "x");
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(FileBatchTest, SyncsBeforeAndAfterTheNamesAreGiven) {
  std::string calls;
  const FileFaultHook hook = [&calls](const FileCall& call) {
    calls += "owsSr"[static_cast<int>(call.operation)];
    return FileFault{};
  };
  set_file_fault_hook(&hook);
  FileBatch batch(folder_ / "beside");
  batch.write(folder_ / "a", "x");
  batch.write(folder_ / "b", "y");
  batch.commit();
  EXPECT_EQ(calls, "oowowSrrS");
  // What was found there must be durable, too.
  calls.clear();
  FileBatch nothing(folder_ / "none");
  nothing.commit();
  EXPECT_EQ(calls, "oS");
}

TEST_F(FileBatchTest, ErrorAtAnyCallLeavesWholeFilesOrNone) {
  for (int nth = 1;; ++nth) {
    int count = 0;
    const FileFaultHook hook = [&](const FileCall&) { return FileFault{++count == nth ? EIO : 0}; };
    set_file_fault_hook(&hook);
    bool has_failed = false;
    try {
      FileBatch batch(folder_ / "beside");
      for (const auto& [name, data] : whole_) {
        batch.write(folder_ / name, data);
      }
      batch.commit();
    } catch (const Error& error) {
      has_failed = true;
      EXPECT_EQ(error.code(), Code::kUnavailable);
    }
    set_file_fault_hook(nullptr);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "beside")) << nth;
    for (const auto& [name, data] : files()) {
      EXPECT_EQ(data, whole_.at(name)) << nth;
      std::filesystem::remove(folder_ / name);
    }
    if (!has_failed) {
      EXPECT_EQ(count, 11);
      EXPECT_EQ(nth, count + 1);
      break;
    }
  }
}

}  // namespace
}  // namespace weft::core
