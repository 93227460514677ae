#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "cli/result_cache.h"
#include "core/error.h"
#include "tests/cli_programs.h"

namespace weft::cli {
namespace {

const core::Digest kShard = core::digest_of("shard 0");

TEST(ResultCache, RemembersResultsAcrossRuns) {
  const TestFolder folder;
  core::Digest result;
  {
    ResultCache cache(folder.path());
    EXPECT_FALSE(cache.find(kShard));
    result = cache.put(kShard, "result");
    EXPECT_EQ(cache.find(kShard), result);
  }
  const ResultCache again(folder.path());
  ASSERT_EQ(again.find(kShard), result);
  EXPECT_EQ(again.read(result), "result");
}

TEST(ResultCache, ALineThatWasNotWrittenToItsEndIsPassedOver) {
  const TestFolder folder;
  const core::Digest other = core::digest_of("shard 1");
  { (void)ResultCache(folder.path()).put(kShard, "result"); }
  std::ofstream(folder / "index", std::ios::app) << other.hex() << " 12ab";
  {
    ResultCache cache(folder.path());
    EXPECT_TRUE(cache.find(kShard));
    EXPECT_FALSE(cache.find(other));
    (void)cache.put(other, "second");
  }
  const ResultCache again(folder.path());
  EXPECT_TRUE(again.find(kShard));
  EXPECT_TRUE(again.find(other)) << "the entry after a torn line is lost";
}

TEST(ResultCache, ADamagedResultIsNotFoundAndComputedAgain) {
  const TestFolder folder;
  ResultCache cache(folder.path());
  const core::Digest result = cache.put(kShard, "result");
  const storage::BlobStore blobs(folder.path());
  std::ofstream(blobs.path_of(result)) << "damage";
  EXPECT_FALSE(cache.find(kShard));
  EXPECT_EQ(cache.put(kShard, "result"), result);
  EXPECT_EQ(cache.find(kShard), result);
}

TEST(ResultCache, AMissingResultIsDataLossWithAHint) {
  const TestFolder folder;
  const ResultCache cache(folder.path());
  try {
    (void)cache.read(core::digest_of("nothing"));
    FAIL() << "a result that does not exist was read";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kDataLoss);
  }
}

TEST(ResultCache, AFolderIsHeldByOneRun) {
  const TestFolder folder;
  {
    const FolderLock lock(folder.path());
    EXPECT_THROW(FolderLock(folder.path()), core::Error);
  }
  EXPECT_NO_THROW(FolderLock(folder.path()));
}

}  // namespace
}  // namespace weft::cli
