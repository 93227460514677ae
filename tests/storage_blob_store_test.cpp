#include <fstream>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "storage/blob_store.h"

namespace weft::storage {
namespace {

class BlobStoreTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::remove_all(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("weft_blobs_") + testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(BlobStoreTest, GivesBackWhatWasPut) {
  BlobStore store(folder_);
  const core::Digest digest = store.put("warp and weft");
  EXPECT_EQ(digest, core::digest_of("warp and weft"));
  EXPECT_TRUE(store.has(digest));
  EXPECT_EQ(store.get(digest), "warp and weft");
  EXPECT_EQ(store.put("warp and weft"), digest);
  EXPECT_EQ(BlobStore(folder_).get(digest), "warp and weft");
}

TEST_F(BlobStoreTest, HoldsTheEmptyBlob) {
  BlobStore store(folder_);
  EXPECT_EQ(store.get(store.put("")), "");
}

TEST_F(BlobStoreTest, KnowsNothingThatWasNotPut) {
  const BlobStore store(folder_);
  EXPECT_FALSE(store.has(core::digest_of("x")));
  EXPECT_EQ(store.get(core::digest_of("x")), std::nullopt);
}

TEST_F(BlobStoreTest, DamagedBlobCountsAsAbsentAndIsRemoved) {
  BlobStore store(folder_);
  const core::Digest digest = store.put("warp and weft");
  std::ofstream(store.path_of(digest), std::ios::binary) << "warp and left";
  EXPECT_EQ(store.get(digest), std::nullopt);
  EXPECT_FALSE(store.has(digest));
  store.put("warp and weft");
  EXPECT_EQ(store.get(digest), "warp and weft");
}

TEST_F(BlobStoreTest, TruncatedBlobIsWrittenAgainByPut) {
  BlobStore store(folder_);
  const core::Digest digest = store.put("warp and weft");
  std::filesystem::resize_file(store.path_of(digest), 4);
  store.put("warp and weft");
  EXPECT_EQ(store.get(digest), "warp and weft");
}

TEST_F(BlobStoreTest, ManyThreadsPutTheSameBlobAtOnce) {
  BlobStore store(folder_);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&store] {
      for (int i = 0; i < 20; ++i) {
        store.put("blob " + std::to_string(i));
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_)) {
    files += entry.is_regular_file() ? 1 : 0;
  }
  EXPECT_EQ(files, 20U);
  EXPECT_EQ(store.get(core::digest_of("blob 7")), "blob 7");
}

TEST_F(BlobStoreTest, BatchIsThereWhenItIsCommitted) {
  BlobStore store(folder_);
  const core::Digest there = store.put("there");
  const core::Digest damaged = store.put("damaged");
  std::ofstream(store.path_of(damaged), std::ios::binary) << "dAmaged";
  const core::Digest fresh = core::digest_of("fresh");
  {
    BlobStore::Batch batch(store);
    EXPECT_TRUE(batch.put(there, "there"));
    EXPECT_FALSE(batch.put(damaged, "damaged"));
    EXPECT_FALSE(batch.put(fresh, "fresh"));
    EXPECT_TRUE(batch.put(fresh, "fresh"));
    EXPECT_FALSE(store.has(fresh));
    std::size_t blobs = 0;
    store.visit([&](const BlobStore::Entry&) { ++blobs; });
    EXPECT_EQ(blobs, 1U);
    batch.commit();
  }
  EXPECT_EQ(store.get(there), "there");
  EXPECT_EQ(store.get(damaged), "damaged");
  EXPECT_EQ(store.get(fresh), "fresh");
}

TEST_F(BlobStoreTest, WhatABatchLeftWhenItsProcessDiedIsRemoved) {
  BlobStore store(folder_);
  const core::Digest there = store.put("there");
  std::filesystem::create_directories(folder_ / "incoming" / "77.1");
  core::write_file_atomically(folder_ / "incoming" / "77.1" / "0", "half of a bl");
  store.remove_unfinished();
  EXPECT_FALSE(std::filesystem::exists(folder_ / "incoming" / "77.1"));
  EXPECT_EQ(store.get(there), "there");
}

TEST_F(BlobStoreTest, FolderThatCannotBeMadeIsAnError) {
  std::filesystem::create_directories(folder_);
  core::write_file_atomically(folder_ / "file", "not a folder");
  try {
    const BlobStore store(folder_ / "file" / "blobs");
    FAIL() << "no error";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kUnavailable);
    EXPECT_NE(std::string(error.what()).find("cannot make the folder"), std::string::npos);
  }
}

}  // namespace
}  // namespace weft::storage
