#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "tests/cli_programs.h"

// Fetching from a real coordinator that has one published version.

namespace weft::cli {
namespace {

class Fetch : public testing::Test {
 protected:
  void SetUp() override {
    const Finished submitted = cluster_.weft(
        {"submit", write_description(folder_, "512"), "--wait", "-o", folder_ / "whole.h5"});
    ASSERT_EQ(submitted.code, 0) << submitted.err;
    const Finished listed = cluster_.weft({"versions", "tiny", "--json"});
    ASSERT_EQ(listed.code, 0) << listed.err;
    digest_ = listed.json().at(0).at("content_digest");
    whole_ = core::read_file(folder_ / "whole.h5");
  }

  [[nodiscard]] std::string part_of(const std::string& output) const {
    return output + "." + digest_.substr(0, 16) + ".part";
  }

  TestFolder folder_;
  TestCluster cluster_{folder_, "fetch", 1};
  std::string digest_;
  std::string whole_;
};

TEST_F(Fetch, GoesOnBehindWholePiecesWhereItWasBrokenOff) {
  const std::string output = folder_ / "out.h5";
  std::ofstream(part_of(output), std::ios::binary) << whole_.substr(0, whole_.size() / 2);
  const Finished fetched = cluster_.weft({"fetch", "tiny@1", "-o", output, "--json"});
  ASSERT_EQ(fetched.code, 0) << fetched.err;
  const std::uint64_t kept = fetched.json().at("bytes_kept");
  EXPECT_LE(kept, whole_.size() / 2);
  EXPECT_GT(kept, whole_.size() / 2 - (std::size_t{256} << 10));
  EXPECT_EQ(fetched.json().at("bytes_fetched"), whole_.size() - kept);
  EXPECT_EQ(core::read_file(output), whole_);
  EXPECT_FALSE(std::filesystem::exists(part_of(output)));
}

TEST_F(Fetch, WhatIsNotTheVersionIsFetchedAnew) {
  const std::string output = folder_ / "out.h5";
  std::ofstream(part_of(output), std::ios::binary) << std::string(whole_.size() + 5, 'x');
  const Finished fetched = cluster_.weft({"fetch", "tiny@1", "-o", output, "--json"});
  ASSERT_EQ(fetched.code, 0) << fetched.err;
  EXPECT_EQ(fetched.json().at("bytes_kept"), 0U);
  EXPECT_EQ(core::read_file(output), whole_);
}

TEST_F(Fetch, AFileThatIsThereAlreadyIsKeptAndADamagedOneIsReplaced) {
  const Finished kept = cluster_.weft({"fetch", "tiny", "-o", folder_ / "whole.h5", "--json"});
  ASSERT_EQ(kept.code, 0) << kept.err;
  EXPECT_EQ(kept.json().at("was_there"), true);
  std::string damaged = whole_;
  damaged[damaged.size() / 2] = static_cast<char>(damaged[damaged.size() / 2] ^ 1);
  core::write_file_atomically(folder_ / "whole.h5", damaged);
  const Finished fetched = cluster_.weft({"fetch", "tiny", "-o", folder_ / "whole.h5", "--json"});
  ASSERT_EQ(fetched.code, 0) << fetched.err;
  EXPECT_EQ(fetched.json().at("was_there"), false);
  EXPECT_EQ(core::read_file(folder_ / "whole.h5"), whole_);
}

}  // namespace
}  // namespace weft::cli
