#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "core/clock.h"
#include "core/error.h"
#include "storage/blob_reader.h"
#include "storage/blob_uploads.h"

namespace weft::storage {
namespace {

template <class Function>
core::Code code_of(Function function) {
  try {
    function();
  } catch (const core::Error& error) {
    return error.code();
  }
  return core::Code::kInternal;
}

class BlobUploadsTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    store_ = std::make_unique<BlobStore>(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) /
                                  (std::string("weft_uploads_") +
                                   testing::UnitTest::GetInstance()->current_test_info()->name());
  std::unique_ptr<BlobStore> store_;
  const std::string data_ = "warp and weft, over and under";
  const core::Digest digest_ = core::digest_of(data_);
};

TEST_F(BlobUploadsTest, GoOnWhereTheyWereBrokenOff) {
  {
    BlobUploads uploads(*store_);
    EXPECT_EQ(uploads.committed_bytes(digest_), 0U);
    const auto upload = uploads.begin(digest_, data_.size(), 0);
    upload->add(data_.substr(0, 4));
    upload->add(data_.substr(4, 3));
  }
  EXPECT_FALSE(store_->has(digest_));
  BlobUploads uploads(*store_);  // after a restart, too
  ASSERT_EQ(uploads.committed_bytes(digest_), 7U);
  {
    const auto upload = uploads.begin(digest_, data_.size(), 7);
    upload->add(data_.substr(7));
    upload->finish();
  }
  EXPECT_EQ(store_->get(digest_), data_);
  EXPECT_EQ(uploads.committed_bytes(digest_), 0U);
}

TEST_F(BlobUploadsTest, BeginAtNothingOrWhereTheyAre) {
  BlobUploads uploads(*store_);
  EXPECT_EQ(code_of([&] { (void)uploads.begin(digest_, data_.size(), 3); }),
            core::Code::kInvalidArgument);
  uploads.begin(digest_, data_.size(), 0)->add(data_.substr(0, 5));
  EXPECT_EQ(code_of([&] { (void)uploads.begin(digest_, data_.size(), 4); }),
            core::Code::kInvalidArgument);
  const auto anew = uploads.begin(digest_, data_.size(), 0);
  ASSERT_NE(anew, nullptr);
  anew->add(data_);
  anew->finish();
  EXPECT_EQ(store_->get(digest_), data_);
}

TEST_F(BlobUploadsTest, OfOneBlobAreOneAtATime) {
  BlobUploads uploads(*store_);
  auto first = uploads.begin(digest_, data_.size(), 0);
  EXPECT_EQ(uploads.begin(digest_, data_.size(), 0), nullptr);
  EXPECT_NE(uploads.begin(core::digest_of("other"), 5, 0), nullptr);
  first.reset();
  EXPECT_NE(uploads.begin(digest_, data_.size(), 0), nullptr);
}

TEST_F(BlobUploadsTest, OfOtherBytesThanAnnounced_StoreNothing) {
  BlobUploads uploads(*store_);
  {
    const auto upload = uploads.begin(digest_, data_.size(), 0);
    upload->add(std::string(data_.size(), 'x'));
    EXPECT_EQ(code_of([&] { upload->finish(); }), core::Code::kDataLoss);
  }
  EXPECT_EQ(uploads.committed_bytes(digest_), 0U);
  {
    const auto upload = uploads.begin(digest_, data_.size(), 0);
    upload->add(data_);
    EXPECT_EQ(code_of([&] { upload->add("x"); }), core::Code::kDataLoss);
  }
  {
    const auto upload = uploads.begin(digest_, data_.size(), 0);
    upload->add(data_.substr(1));
    EXPECT_EQ(code_of([&] { upload->finish(); }), core::Code::kDataLoss);
  }
  EXPECT_FALSE(store_->has(digest_));
}

TEST_F(BlobUploadsTest, WhatPowerTookFromTheirMiddleIsFoundOut) {
  BlobUploads uploads(*store_);
  uploads.begin(digest_, data_.size(), 0)->add(data_.substr(0, 9));
  std::ofstream(folder_ / "uploads" / digest_.hex(), std::ios::binary) << std::string(9, '\0');
  {
    const auto upload = uploads.begin(digest_, data_.size(), 9);
    upload->add(data_.substr(9));
    EXPECT_EQ(code_of([&] { upload->finish(); }), core::Code::kDataLoss);
  }
  EXPECT_EQ(uploads.committed_bytes(digest_), 0U);
}

TEST_F(BlobUploadsTest, ThatAreOldOrTooManyAreSwept) {
  UploadLimits limits;
  limits.kept = 2;
  BlobUploads uploads(*store_, limits);
  const auto keep = [&](const std::string& text) {
    uploads.begin(core::digest_of(text), text.size(), 0)->add(text.substr(1));
  };
  keep("one");
  keep("two");
  EXPECT_EQ(uploads.sweep(0), 0U);
  keep("three");
  const auto active = uploads.begin(core::digest_of("four"), 4, 0);
  EXPECT_EQ(uploads.sweep(0), 2U);
  const std::int64_t later_ms =
      core::system_clock().now().time_since_epoch().count() + std::int64_t{60'000};
  EXPECT_EQ(uploads.sweep(later_ms), 1U);
  active->add("four");
  active->finish();
  EXPECT_TRUE(store_->has(core::digest_of("four")));
}

TEST_F(BlobUploadsTest, TrashedBlobComesBackWhenItIsUsed) {
  const std::int64_t later_ms =
      core::system_clock().now().time_since_epoch().count() + std::int64_t{60'000};
  const core::Digest digest = store_->put(data_);
  EXPECT_FALSE(store_->trash(digest, later_ms - 120'000)) << "it is younger";
  ASSERT_TRUE(store_->trash(digest, later_ms));
  EXPECT_FALSE(store_->has(digest));
  EXPECT_EQ(store_->use(digest), data_.size());
  EXPECT_TRUE(store_->has(digest));
  ASSERT_TRUE(store_->trash(digest, later_ms));
  EXPECT_EQ(store_->get(digest), data_);
  ASSERT_TRUE(store_->trash(digest, later_ms));
  EXPECT_EQ(store_->put(data_), digest);
  EXPECT_FALSE(store_->empty(digest, later_ms)) << "it is not in the trash";
  ASSERT_TRUE(store_->trash(digest, later_ms));
  EXPECT_FALSE(store_->empty(digest, later_ms - 120'000)) << "it lies there for a moment only";
  std::size_t in_trash = 0;
  store_->visit_trash([&](const BlobStore::Entry& entry) {
    EXPECT_EQ(entry.digest, digest);
    ++in_trash;
  });
  EXPECT_EQ(in_trash, 1U);
  store_->visit([](const BlobStore::Entry&) { ADD_FAILURE(); });
  ASSERT_TRUE(store_->empty(digest, later_ms));
  EXPECT_EQ(store_->get(digest), std::nullopt);
}

TEST_F(BlobUploadsTest, ReaderChecksAllBytesWhereverItBegins) {
  const core::Digest digest = store_->put(data_);
  for (const std::size_t begin : {std::size_t{0}, std::size_t{5}, data_.size()}) {
    auto reader = BlobReader::open(*store_, digest);
    ASSERT_TRUE(reader);
    reader->skip(begin);
    std::string read;
    while (!reader->is_over()) {
      read += reader->read(4);
    }
    EXPECT_EQ(read, data_.substr(begin));
    EXPECT_EQ(reader->read(4), "");
  }
  const core::Digest nothing = store_->put("");
  EXPECT_EQ(BlobReader::open(*store_, nothing)->read(4), "");
  EXPECT_FALSE(BlobReader::open(*store_, core::digest_of("never")));

  std::fstream file(store_->path_of(digest), std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(2);
  file.put('x');
  file.close();
  auto reader = BlobReader::open(*store_, digest);
  reader->skip(data_.size() - 1);
  EXPECT_EQ(code_of([&] { (void)reader->read(4); }), core::Code::kDataLoss);
  EXPECT_FALSE(store_->has(digest));
}

}  // namespace
}  // namespace weft::storage
