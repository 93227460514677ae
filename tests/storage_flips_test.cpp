#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "core/random.h"
#include "storage/database_fields.h"
#include "storage/fabric_database.h"
#include "storage/user_block.h"
#include "tests/storage_test_database.h"

// Every single byte of a small database that is another, and every length that is cut short: a
// sample of 2,000 each, and of 500 where a process is started for each, or with WEFT_LONG=1 every
// one.

namespace weft::storage {
namespace {

constexpr std::size_t kSample = 2000;
constexpr std::size_t kSandboxSample = 500;

bool is_long_run() {
  const char* value = std::getenv("WEFT_LONG");  // NOLINT(concurrency-mt-unsafe)
  return value != nullptr && std::string(value) == "1";
}

// Places in [0, end), rising: all of them, or `sample` spread evenly, the first and the last among
// them.
std::vector<std::size_t> places(std::size_t end, std::size_t sample) {
  const std::size_t count = is_long_run() ? end : std::min(end, sample);
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < count; ++i) {
    result.push_back(count == 1 ? 0 : i * (end - 1) / (count - 1));
  }
  return result;
}

std::string sealed(std::string bytes) {
  UserBlock block;
  block.file_bytes = bytes.size();
  block.digest = core::digest_of(std::string_view(bytes).substr(kUserBlockBytes));
  return bytes.replace(0, kUserBlockBytes, encode_user_block(block));
}

class FlipsTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_);
    write_database(small_database(), path_);
    bytes_ = core::read_file(path_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::string flipped(std::size_t at) const {
    std::string bytes = bytes_;
    bytes[at] = static_cast<char>(
        bytes[at] ^ (1 + core::Random(41, static_cast<std::uint32_t>(at)).below(255)));
    return bytes;
  }

  void put(const std::string& bytes) const {
    FILE* file = std::fopen(path_.c_str(), "wb");
    std::fwrite(bytes.data(), 1, bytes.size(), file);
    std::fclose(file);
  }

  // Whether verifying a file of these bytes ends in an error.
  [[nodiscard]] bool is_noticed(const std::string& bytes) const {
    put(bytes);
    try {
      verify_database(path_);
    } catch (const core::Error&) {
      return true;
    }
    return false;
  }

  enum class Outcome { kRead, kRefused, kContained };

  // Has these bytes read under a right digest, as someone who means harm would send them: the
  // parser really sees the damage. What is read passes the checks of data once more.
  [[nodiscard]] Outcome outcome(const std::string& bytes) const {
    put(sealed(bytes));
    try {
      check_values(read_database(path_));
      return Outcome::kRead;
    } catch (const core::Error& error) {
      const bool crashed = std::string(error.what()).find("crashed") != std::string::npos;
      return crashed ? Outcome::kContained : Outcome::kRefused;
    }
  }

  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("weft_flips_") + testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::path path_ = folder_ / "small.h5";
  std::string bytes_;
};

TEST_F(FlipsTest, EveryFlippedByteIsNoticed) {
  for (const std::size_t at : places(bytes_.size(), kSample)) {
    ASSERT_TRUE(is_noticed(flipped(at))) << "byte " << at;
  }
}

TEST_F(FlipsTest, EveryTruncationIsNoticed) {
  for (const std::size_t length : places(bytes_.size(), kSample)) {
    ASSERT_TRUE(is_noticed(bytes_.substr(0, length))) << length << " bytes";
  }
}

// HDF5 itself does crash, apart; here nothing does.
TEST_F(FlipsTest, UnderARightDigestNothingCrashesHereAndWhatIsReadPassesTheChecks) {
  std::map<Outcome, std::size_t> counts;
  for (const std::size_t at : places(bytes_.size() - kUserBlockBytes, kSandboxSample)) {
    ++counts[outcome(flipped(kUserBlockBytes + at))];
  }
  std::printf(
      "of %zu bytes: %zu flips change nothing that is read, %zu are refused, %zu crash the "
      "library in its sandbox\n",
      bytes_.size() - kUserBlockBytes, counts[Outcome::kRead], counts[Outcome::kRefused],
      counts[Outcome::kContained]);
  EXPECT_GT(counts[Outcome::kRefused], counts[Outcome::kContained]);
}

TEST_F(FlipsTest, UnderARightDigestNoTruncationIsRead) {
  // Most end within the data of one dataset.
  for (const std::size_t at : places(bytes_.size() - kUserBlockBytes, kSandboxSample / 5)) {
    const std::string bytes = bytes_.substr(0, kUserBlockBytes + at);
    EXPECT_NE(outcome(bytes), Outcome::kRead) << bytes.size() << " bytes";
  }
}

}  // namespace
}  // namespace weft::storage
