#include <filesystem>
#include <string>
#include <thread>

#include "core/file.h"
#include "tests/coordinator_service_fixture.h"

// Uploads and downloads of blobs that break off, over a real connection.

namespace weft::coordinator {
namespace {

class Blobs : public ServiceTest {
 protected:
  // Sends `size` bytes from `offset` on, in chunks; all of them announced.
  grpc::Status send(std::uint64_t offset, std::uint64_t size, bool is_broken_off = false) {
    grpc::ClientContext context;
    v1::WriteResponse response;
    const auto writer = blobs_->Write(&context, &response);
    v1::WriteRequest request;
    request.set_digest(digest_.binary());
    request.set_size_bytes(data_.size());
    request.set_offset(offset);
    for (std::uint64_t at = offset; at < offset + size; at += 1 << 16) {
      request.set_data(data_.substr(at, std::min<std::uint64_t>(1 << 16, offset + size - at)));
      if (!writer->Write(request)) {
        break;
      }
      request.Clear();
    }
    if (is_broken_off) {
      wait_until_committed(offset + size);
      context.TryCancel();
    } else {
      writer->WritesDone();
    }
    return writer->Finish();
  }
  v1::QueryWriteResponse query() {
    grpc::ClientContext context;
    v1::QueryWriteRequest request;
    request.set_digest(digest_.binary());
    v1::QueryWriteResponse response;
    EXPECT_TRUE(blobs_->QueryWrite(&context, request, &response).ok());
    return response;
  }
  void wait_until_committed(std::uint64_t bytes) {
    for (int i = 0; i < 2'000 && query().committed_bytes() < bytes; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_EQ(query().committed_bytes(), bytes);
  }
  // The broken stream's handler may still hold the upload.
  grpc::Status send_when_free(std::uint64_t offset, std::uint64_t size) {
    grpc::Status status;
    for (int i = 0; i < 2'000; ++i) {
      status = send(offset, size);
      if (status.error_code() != grpc::StatusCode::ABORTED) {
        break;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return status;
  }

  grpc::Status send_together(const std::vector<std::string>& all) {
    grpc::ClientContext context;
    v1::WriteManyResponse response;
    return blobs_->WriteMany(&context, request_of(all), &response);
  }
  static v1::WriteManyRequest request_of(const std::vector<std::string>& all) {
    v1::WriteManyRequest request;
    for (const std::string& data : all) {
      v1::WholeBlob& blob = *request.add_blobs();
      blob.set_digest(core::digest_of(data).binary());
      blob.set_data(data);
    }
    return request;
  }
  std::string stored(const std::string& data) {
    std::string read_back;
    return read(core::digest_of(data), 0, &read_back).ok() ? read_back : "absent";
  }

  const std::string data_ = [] {
    std::string data(1'000'000, '\0');
    for (std::size_t i = 0; i < data.size(); ++i) {
      data[i] = static_cast<char>((i * i) >> 7 & 0xff);
    }
    return data;
  }();
  const core::Digest digest_ = core::digest_of(data_);
};

TEST_F(Blobs, BrokenUploadGoesOnWhereItWas) {
  EXPECT_FALSE(query().complete());
  EXPECT_FALSE(send(0, 300'000, true).ok());
  EXPECT_EQ(send_when_free(299'999, 1).error_code(), grpc::StatusCode::OUT_OF_RANGE);
  stop();
  start();
  ASSERT_EQ(query().committed_bytes(), 300'000U);
  const grpc::Status status = send_when_free(300'000, data_.size() - 300'000);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(query().complete());
  EXPECT_EQ(query().committed_bytes(), data_.size());
  std::string read_back;
  EXPECT_TRUE(read(digest_, 0, &read_back).ok());
  EXPECT_EQ(read_back, data_);
  read_back.clear();
  EXPECT_TRUE(read(digest_, 999'000, &read_back).ok());
  EXPECT_EQ(read_back, data_.substr(999'000));
}

TEST_F(Blobs, UploadOfWhatIsThereSucceedsAtOnce) {
  ASSERT_TRUE(send(0, data_.size()).ok());
  EXPECT_TRUE(send(0, 1 << 16).ok()) << "without the rest of the bytes";
}

TEST_F(Blobs, DiskThatTakesNothingIsAShortResource) {
  const std::filesystem::path in_the_way = folder_ / "state" / "blobs" / digest_.hex().substr(0, 2);
  core::write_file_atomically(in_the_way, "no folder");
  const grpc::Status status = send(0, data_.size());
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
  EXPECT_NE(status.error_message().find("cannot"), std::string::npos) << status.error_message();
  std::filesystem::remove(in_the_way);
  EXPECT_TRUE(send_when_free(0, data_.size()).ok());
  EXPECT_TRUE(query().complete());
}

TEST_F(Blobs, SecondUploadAtOnceIsToldToWait) {
  grpc::ClientContext context;
  v1::WriteResponse response;
  const auto writer = blobs_->Write(&context, &response);
  v1::WriteRequest request;
  request.set_digest(digest_.binary());
  request.set_size_bytes(data_.size());
  request.set_data(data_.substr(0, 1000));
  writer->Write(request);
  wait_until_committed(1000);
  EXPECT_EQ(send(0, data_.size()).error_code(), grpc::StatusCode::ABORTED);
  request.Clear();
  request.set_data(data_.substr(1000));
  writer->Write(request);
  writer->WritesDone();
  EXPECT_TRUE(writer->Finish().ok());
  EXPECT_TRUE(send(0, data_.size()).ok());
}

TEST_F(Blobs, UploadThatEndsEarlyStoresNothingAndKeepsWhatCame) {
  EXPECT_EQ(send(0, 100'000).error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_FALSE(query().complete());
  EXPECT_EQ(query().committed_bytes(), 100'000U);
}

// As a power loss may leave it.
TEST_F(Blobs, UploadOnTopOfDamagedBytes_IsToldSoAndBeginsAgain) {
  EXPECT_FALSE(send(0, 300'000, true).ok());
  stop();
  const std::filesystem::path kept = folder_ / "state" / "blobs" / "uploads" / digest_.hex();
  std::string bytes = core::read_file(kept);
  bytes[200'000] = static_cast<char>(bytes[200'000] ^ 1);
  core::write_file_atomically(kept, bytes);
  start();
  ASSERT_EQ(query().committed_bytes(), 300'000U);
  EXPECT_EQ(send_when_free(300'000, data_.size() - 300'000).error_code(),
            grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(query().committed_bytes(), 0U);
  EXPECT_TRUE(send_when_free(0, data_.size()).ok());
  EXPECT_TRUE(query().complete());
}

TEST_F(Blobs, SmallOnesAreStoredTogether) {
  ASSERT_TRUE(send_together({"one", "", data_, "one"}).ok());
  ASSERT_TRUE(send_together({"one", "two"}).ok()) << "one of them is there already";
  EXPECT_EQ(stored("one"), "one");
  EXPECT_EQ(stored(""), "");
  EXPECT_EQ(stored("two"), "two");
  EXPECT_EQ(stored(data_), data_);
  EXPECT_TRUE(send_together({}).ok());
}

TEST_F(Blobs, OfSmallOnesTogetherNoneIsStoredWhenOneIsDamaged) {
  v1::WriteManyRequest request = request_of({"one", "two"});
  request.mutable_blobs(1)->set_data("twO");
  grpc::ClientContext context;
  v1::WriteManyResponse response;
  const grpc::Status status = blobs_->WriteMany(&context, request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DATA_LOSS) << status.error_message();
  EXPECT_EQ(stored("one"), "absent");
}

TEST_F(Blobs, TooMuchTogetherIsRefused) {
  const std::string large(v1::kChunkLimitBytes + 1, 'x');
  EXPECT_EQ(send_together({"one", large}).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  const std::vector<std::string> many(5, large.substr(1));
  EXPECT_EQ(send_together(many).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(stored("one"), "absent");
}

TEST_F(Blobs, DiskThatTakesNothingOfManyIsAShortResource) {
  const std::filesystem::path in_the_way =
      folder_ / "state" / "blobs" / core::digest_of("one").hex().substr(0, 2);
  core::write_file_atomically(in_the_way, "no folder");
  const grpc::Status status = send_together({"one", "two"});
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
  std::filesystem::remove(in_the_way);
  EXPECT_TRUE(send_together({"one", "two"}).ok());
  EXPECT_EQ(stored("one"), "one");
}

}  // namespace
}  // namespace weft::coordinator
