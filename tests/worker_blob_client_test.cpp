#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include "core/digest.h"
#include "core/error.h"
#include "proto/limits.h"
#include "worker/blob_client.h"

namespace weft::worker {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;

// Takes one upload as cluster.proto says; may break off the first one, and damage what came.
class OneUpload final : public v1::BlobService::Service {
 public:
  OneUpload() {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
    channel_ = grpc::CreateChannel("127.0.0.1:" + std::to_string(port),
                                   grpc::InsecureChannelCredentials());
  }
  ~OneUpload() override { server_->Shutdown(); }
  OneUpload(const OneUpload&) = delete;
  OneUpload& operator=(const OneUpload&) = delete;
  OneUpload(OneUpload&&) = delete;
  OneUpload& operator=(OneUpload&&) = delete;

  [[nodiscard]] const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  [[nodiscard]] std::vector<std::uint64_t> offsets() {
    const std::lock_guard lock(mutex_);
    return offsets_;
  }
  [[nodiscard]] std::string stored() {
    const std::lock_guard lock(mutex_);
    return stored_;
  }

  std::size_t breaks_off_behind = 0;  // bytes of the first upload
  bool damages_what_came = false;
  grpc::StatusCode breaks_off_with = grpc::StatusCode::UNAVAILABLE;

  grpc::Status QueryWrite(grpc::ServerContext* /*context*/,
                          const v1::QueryWriteRequest* /*request*/,
                          v1::QueryWriteResponse* response) override {
    const std::lock_guard lock(mutex_);
    response->set_complete(!stored_.empty());
    response->set_committed_bytes(kept_.size());
    return grpc::Status::OK;
  }

  grpc::Status WriteMany(grpc::ServerContext* /*context*/, const v1::WriteManyRequest* request,
                         v1::WriteManyResponse* /*response*/) override {
    const std::lock_guard lock(mutex_);
    if (calls_++ == 0 && breaks_off_behind > 0) {
      return {breaks_off_with, "the power went"};
    }
    for (const v1::WholeBlob& blob : request->blobs()) {
      stored_ += blob.data();
    }
    return grpc::Status::OK;
  }

  grpc::Status Write(grpc::ServerContext* /*context*/, grpc::ServerReader<v1::WriteRequest>* reader,
                     v1::WriteResponse* /*response*/) override {
    const std::lock_guard lock(mutex_);
    v1::WriteRequest request;
    core::Digest digest;
    for (bool is_first = true; reader->Read(&request); is_first = false) {
      if (is_first) {
        digest = *core::Digest::from_binary(request.digest());
        offsets_.push_back(request.offset());
        kept_.resize(request.offset());
      }
      kept_ += request.data();
      if (offsets_.size() == 1 && breaks_off_behind > 0 && kept_.size() >= breaks_off_behind) {
        kept_[1000] = static_cast<char>(kept_[1000] ^ (damages_what_came ? 1 : 0));
        return {breaks_off_with, "the power went"};
      }
    }
    if (core::digest_of(kept_) != digest) {
      kept_.clear();
      return {grpc::StatusCode::DATA_LOSS, "other bytes than were announced"};
    }
    stored_ = kept_;
    return grpc::Status::OK;
  }

 private:
  std::mutex mutex_;
  std::string kept_;
  std::string stored_;
  std::vector<std::uint64_t> offsets_;
  int calls_ = 0;  // of WriteMany
  std::unique_ptr<grpc::Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
};

const std::string kData = [] {
  std::string data(3 * kMiB + 77, '\0');
  for (std::size_t i = 0; i < data.size(); ++i) {
    data[i] = static_cast<char>((i * i) >> 7 & 0xff);
  }
  return data;
}();

bool goes_on() { return false; }

TEST(BlobClient, BrokenUploadGoesOnWhereItWas) {
  OneUpload coordinator;
  coordinator.breaks_off_behind = 2 * kMiB;
  BlobClient(coordinator.channel()).write({{core::digest_of(kData), kData}}, goes_on);
  EXPECT_EQ(coordinator.stored(), kData);
  EXPECT_EQ(coordinator.offsets(), (std::vector<std::uint64_t>{0, 2 * kMiB}));
}

// A coordinator that stops cancels what it is answering: the upload goes on when it is back.
TEST(BlobClient, CancelledUploadGoesOnWhereItWas) {
  OneUpload coordinator;
  coordinator.breaks_off_behind = 2 * kMiB;
  coordinator.breaks_off_with = grpc::StatusCode::CANCELLED;
  BlobClient(coordinator.channel()).write({{core::digest_of(kData), kData}}, goes_on);
  EXPECT_EQ(coordinator.stored(), kData);
  EXPECT_EQ(coordinator.offsets(), (std::vector<std::uint64_t>{0, 2 * kMiB}));
}

TEST(BlobClient, SmallOnesGoTogetherAndAgainWhenTheCallBreaksOff) {
  OneUpload coordinator;
  coordinator.breaks_off_behind = 1;
  BlobClient(coordinator.channel())
      .write({{core::digest_of("one"), "one"}, {core::digest_of("two"), "two"}}, goes_on);
  EXPECT_EQ(coordinator.stored(), "onetwo");
}

TEST(BlobClient, SmallOnesThatThereIsNoRoomForAreAnError) {
  OneUpload coordinator;
  coordinator.breaks_off_behind = 1;
  coordinator.breaks_off_with = grpc::StatusCode::RESOURCE_EXHAUSTED;
  try {
    BlobClient(coordinator.channel()).write({{core::digest_of("one"), "one"}}, goes_on);
    FAIL() << "no error";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
  }
}

TEST(BlobClient, ClosedClientUploadsNothing) {
  OneUpload coordinator;
  BlobClient client(coordinator.channel());
  client.close();
  try {
    client.write({{core::digest_of(kData), kData}}, goes_on);
    FAIL() << "no error";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kCancelled);
  }
  EXPECT_EQ(coordinator.stored(), "");
}

TEST(BlobClient, UploadBeginsAgainWhenWhatWasKeptIsDamaged) {
  OneUpload coordinator;
  coordinator.breaks_off_behind = 2 * kMiB;
  coordinator.damages_what_came = true;
  BlobClient(coordinator.channel()).write({{core::digest_of(kData), kData}}, goes_on);
  EXPECT_EQ(coordinator.stored(), kData);
  EXPECT_EQ(coordinator.offsets(), (std::vector<std::uint64_t>{0, 2 * kMiB, 0}));
}

TEST(BlobClient, WrongBytesFromTheBeginningAreAnError) {
  OneUpload coordinator;
  try {
    BlobClient(coordinator.channel()).write({{core::digest_of("something else"), kData}}, goes_on);
    FAIL() << "no error";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kDataLoss);
  }
  EXPECT_EQ(coordinator.offsets().size(), 1U);
}

}  // namespace
}  // namespace weft::worker
