#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "coordinator/services/open_streams.h"
#include "core/error.h"
#include "proto/limits.h"
#include "tests/coordinator_service_fixture.h"

// Each limit of proto/limits.h that a caller of the coordinator can meet, met.

namespace weft::coordinator {
namespace {

using testing::HasSubstr;

class LimitsTest : public ServiceTest {
 protected:
  static void expect_limit(const grpc::Status& status, const std::string& limit) {
    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
    EXPECT_THAT(status.error_message(), testing::StartsWith(limit + ":"));
  }
};

// WatchJob calls that stay open.
class Watchers {
 public:
  Watchers(std::string address, std::string job)
      : address_(std::move(address)), request_([&] {
          v1::WatchJobRequest request;
          request.set_job_id(job);
          return request;
        }()) {}
  ~Watchers() {
    for (const std::unique_ptr<Call>& call : calls_) {
      call->context.TryCancel();
      v1::WatchJobResponse response;
      while (call->reader->Read(&response)) {
      }
      (void)call->reader->Finish();
    }
  }
  Watchers(const Watchers&) = delete;
  Watchers& operator=(const Watchers&) = delete;
  Watchers(Watchers&&) = delete;
  Watchers& operator=(Watchers&&) = delete;

  // All further ones come by a connection of their own.
  void connect_anew() {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    stub_ = v1::JobService::NewStub(
        grpc::CreateCustomChannel(address_, grpc::InsecureChannelCredentials(), arguments));
  }
  // Nothing when the call is open now, else how it ended.
  std::optional<grpc::Status> add() {
    auto call = std::make_unique<Call>();
    call->reader = stub_->WatchJob(&call->context, request_);
    v1::WatchJobResponse response;
    if (!call->reader->Read(&response)) {
      return call->reader->Finish();
    }
    calls_.push_back(std::move(call));
    return std::nullopt;
  }

 private:
  struct Call {
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::WatchJobResponse>> reader;
  };
  std::string address_;
  v1::WatchJobRequest request_;
  std::unique_ptr<v1::JobService::Stub> stub_;
  std::vector<std::unique_ptr<Call>> calls_;
};

TEST_F(LimitsTest, WatchersAreLimitedForEachConnectionAndInAll) {
  v1::Job job;
  ASSERT_TRUE(submit("watched", small_description(), &job).ok());
  Watchers watchers(server_->address(), job.id());
  for (int i = 0; i < v1::kWatchersLimit; ++i) {
    if (i % v1::kWatchersPerConnectionLimit == 0) {
      watchers.connect_anew();
    }
    ASSERT_FALSE(watchers.add()) << i;
  }
  watchers.connect_anew();
  const std::optional<grpc::Status> refused = watchers.add();
  ASSERT_TRUE(refused);
  expect_limit(*refused, "watchers_limit");
}

TEST_F(LimitsTest, OneConnectionCannotTakeAllWatchers) {
  v1::Job job;
  ASSERT_TRUE(submit("watched", small_description(), &job).ok());
  Watchers watchers(server_->address(), job.id());
  watchers.connect_anew();
  for (int i = 0; i < v1::kWatchersPerConnectionLimit; ++i) {
    ASSERT_FALSE(watchers.add()) << i;
  }
  const std::optional<grpc::Status> refused = watchers.add();
  ASSERT_TRUE(refused);
  expect_limit(*refused, "watchers_per_connection_limit");
  watchers.connect_anew();
  EXPECT_FALSE(watchers.add()) << "another connection";
}

TEST_F(LimitsTest, ADescriptionABlobAndAMessageHaveASize) {
  v1::FabricDescription description = small_description();
  description.set_name(std::string(v1::kDescriptionLimitBytes, 'a'));
  expect_limit(submit("large", description), "description_bytes_limit");

  grpc::ClientContext context;
  v1::WriteResponse response;
  const auto writer = blobs_->Write(&context, &response);
  v1::WriteRequest request;
  request.set_digest(core::digest_of("x").binary());
  request.set_size_bytes(v1::kBlobLimitBytes + 1);
  writer->Write(request);
  expect_limit(writer->Finish(), "blob_bytes_limit");

  description.set_name(std::string(v1::kMessageLimitBytes, 'a'));
  EXPECT_EQ(submit("larger", description).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

TEST(OpenStreams, CountWhatIsOpen) {
  OpenStreams streams("doors", 3, 2);
  const auto message = [&](const std::string& peer) -> std::string {
    try {
      const OpenStreams::Ticket ticket(streams, peer);
      return "";
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
      return error.what();
    }
  };
  const OpenStreams::Ticket one(streams, "a");
  {
    const OpenStreams::Ticket two(streams, "a");
    EXPECT_THAT(message("a"), HasSubstr("doors_per_connection_limit: this connection has 2"));
    EXPECT_EQ(message("b"), "");
    const OpenStreams::Ticket three(streams, "b");
    EXPECT_THAT(message("b"), HasSubstr("doors_limit: 3 are open"));
  }
  EXPECT_EQ(message("a"), "");
  OpenStreams local("doors", 3, 1);
  const OpenStreams::Ticket first(local, "unix:");
  EXPECT_NO_THROW(OpenStreams::Ticket(local, "unix:"));
}

}  // namespace
}  // namespace weft::coordinator
