#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
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

// More than gRPC takes for a caller that does not read.
constexpr std::size_t kLargeBytes = std::size_t{4} << 20;

std::shared_ptr<grpc::Channel> connected(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);  // takes 64 KiB more than is read, always
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

class LimitsTest : public ServiceTest {
 protected:
  static void expect_limit(const grpc::Status& status, const std::string& limit) {
    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
    EXPECT_THAT(status.error_message(), testing::StartsWith(limit + ":"));
  }

  // Opens as many calls as there may be: by one connection, then by several. `make` gives an object
  // with connect_anew() and add() that holds what it opened.
  template <class Make>
  static void expect_limits(const std::string& name, int limit, int limit_per_connection,
                            const Make& make) {
    {
      const auto calls = make();
      calls->connect_anew();
      for (int i = 0; i < limit_per_connection; ++i) {
        ASSERT_FALSE(calls->add()) << name << " " << i;
      }
      const std::optional<grpc::Status> refused = calls->add();
      ASSERT_TRUE(refused) << name;
      expect_limit(*refused, name + "_per_connection_limit");
      for (int i = limit_per_connection; i < limit; ++i) {
        if (i % limit_per_connection == 0) {
          calls->connect_anew();
        }
        ASSERT_FALSE(calls->add()) << name << " " << i;
      }
      calls->connect_anew();
      const std::optional<grpc::Status> another = calls->add();
      ASSERT_TRUE(another) << name;
      expect_limit(*another, name + "_limit");
    }
    // Those that are over make room, when the server has noticed it.
    const auto calls = make();
    calls->connect_anew();
    std::optional<grpc::Status> refused = calls->add();
    for (int i = 0; i < 2'000 && refused; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      refused = calls->add();
    }
    EXPECT_FALSE(refused) << name << ": " << refused->error_message();
  }

  // A version of kLargeBytes that are nowhere the same.
  std::vector<storage::Piece> publish_large(const std::string& fabric) {
    std::string content(kLargeBytes, '\0');
    std::uint32_t state = 1;
    for (char& byte : content) {
      state = state * 1664525 + 1013904223;
      byte = static_cast<char>(state >> 24);
    }
    Publication publication;
    publication.fabric = fabric;
    publication.file = folder_ / "state" / "committing" / "large.h5";
    publication.content_digest = core::digest_of(content);
    publication.job = "j1";
    core::write_file_atomically(publication.file, content);
    scheduler_->catalogue().prepare(publication);
    (void)scheduler_->catalogue().publish(publication);
    return publication.pieces;
  }
};

// Calls that send something and stay open, because nobody reads on.
template <class Service, class Response>
class HeldReads {
 public:
  using Reader = std::unique_ptr<grpc::ClientReader<Response>>;
  using Start = std::function<Reader(typename Service::Stub& stub, grpc::ClientContext* context)>;

  HeldReads(std::string address, Start start)
      : address_(std::move(address)), start_(std::move(start)) {}
  ~HeldReads() {
    for (const std::unique_ptr<Call>& call : calls_) {
      call->context.TryCancel();
      Response response;
      while (call->reader->Read(&response)) {
      }
      (void)call->reader->Finish();
    }
  }
  HeldReads(const HeldReads&) = delete;
  HeldReads& operator=(const HeldReads&) = delete;
  HeldReads(HeldReads&&) = delete;
  HeldReads& operator=(HeldReads&&) = delete;

  // All further ones come by a connection of their own.
  void connect_anew() { stub_ = Service::NewStub(connected(address_)); }
  // Nothing when the call is open now, else how it ended.
  std::optional<grpc::Status> add() {
    auto call = std::make_unique<Call>();
    call->reader = start_(*stub_, &call->context);
    Response response;
    if (!call->reader->Read(&response)) {
      return call->reader->Finish();
    }
    calls_.push_back(std::move(call));
    return std::nullopt;
  }

 private:
  struct Call {
    grpc::ClientContext context;
    Reader reader;
  };
  std::string address_;
  Start start_;
  std::unique_ptr<typename Service::Stub> stub_;
  std::vector<std::unique_ptr<Call>> calls_;
};

// Uploads of which a part has come.
class HeldUploads {
 public:
  explicit HeldUploads(std::string address) : address_(std::move(address)) {}
  ~HeldUploads() {
    for (const std::unique_ptr<Call>& call : calls_) {
      call->context.TryCancel();
      (void)call->writer->Finish();
    }
  }
  HeldUploads(const HeldUploads&) = delete;
  HeldUploads& operator=(const HeldUploads&) = delete;
  HeldUploads(HeldUploads&&) = delete;
  HeldUploads& operator=(HeldUploads&&) = delete;

  void connect_anew() { stub_ = v1::BlobService::NewStub(connected(address_)); }
  std::optional<grpc::Status> add() {
    auto call = std::make_unique<Call>();
    call->writer = stub_->Write(&call->context, &call->response);
    v1::WriteRequest request;
    const core::Digest digest = core::digest_of("upload " + std::to_string(++begun_));
    request.set_digest(digest.binary());
    request.set_size_bytes(2'000);
    request.set_data(std::string(1'000, 'x'));
    call->writer->Write(request);
    for (int i = 0; i < kPatience && committed(digest) < 1'000; ++i) {
      if (call->has_ended()) {
        return call->writer->Finish();
      }
    }
    calls_.push_back(std::move(call));
    return std::nullopt;
  }

 private:
  static constexpr int kPatience = 1'000;

  struct Call {
    // Only a server that has ended the call does not take more.
    [[nodiscard]] bool has_ended() {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      return !writer->Write(v1::WriteRequest());
    }
    grpc::ClientContext context;
    v1::WriteResponse response;
    std::unique_ptr<grpc::ClientWriter<v1::WriteRequest>> writer;
  };
  std::uint64_t committed(const core::Digest& digest) {
    grpc::ClientContext context;
    v1::QueryWriteRequest request;
    request.set_digest(digest.binary());
    v1::QueryWriteResponse response;
    EXPECT_TRUE(stub_->QueryWrite(&context, request, &response).ok());
    return response.committed_bytes();
  }

  std::string address_;
  std::unique_ptr<v1::BlobService::Stub> stub_;
  std::vector<std::unique_ptr<Call>> calls_;
  int begun_ = 0;
};

TEST_F(LimitsTest, WatchersAreLimitedForEachConnectionAndInAll) {
  v1::Job job;
  ASSERT_TRUE(submit("watched", small_description(), &job).ok());
  v1::WatchJobRequest request;
  request.set_job_id(job.id());
  expect_limits("watchers", v1::kWatchersLimit, v1::kWatchersPerConnectionLimit, [&] {
    return std::make_unique<HeldReads<v1::JobService, v1::WatchJobResponse>>(
        server_->address(), [&](v1::JobService::Stub& stub, grpc::ClientContext* context) {
          return stub.WatchJob(context, request);
        });
  });
}

TEST_F(LimitsTest, FetchesAreLimitedForEachConnectionAndInAll) {
  const std::vector<storage::Piece> pieces = publish_large("large");
  v1::FetchVersionRequest whole;
  whole.set_reference("large");
  using Calls = HeldReads<v1::CatalogueService, v1::FetchVersionResponse>;
  expect_limits("fetches", v1::kFetchesLimit, v1::kFetchesPerConnectionLimit, [&] {
    return std::make_unique<Calls>(
        server_->address(), [&](v1::CatalogueService::Stub& stub, grpc::ClientContext* context) {
          return stub.FetchVersion(context, whole);
        });
  });
  v1::ReadPiecesRequest parts;
  for (const storage::Piece& piece : pieces) {
    parts.add_digests(piece.digest.binary());
  }
  using PieceCalls = HeldReads<v1::CatalogueService, v1::ReadPiecesResponse>;
  expect_limits("fetches", v1::kFetchesLimit, v1::kFetchesPerConnectionLimit, [&] {
    return std::make_unique<PieceCalls>(
        server_->address(), [&](v1::CatalogueService::Stub& stub, grpc::ClientContext* context) {
          return stub.ReadPieces(context, parts);
        });
  });
}

TEST_F(LimitsTest, BlobReadsAreLimitedForEachConnectionAndInAll) {
  v1::ReadRequest request;
  request.set_digest(scheduler_->blobs().put(std::string(kLargeBytes, 'x')).binary());
  expect_limits("blob_reads", v1::kBlobReadsLimit, v1::kBlobReadsPerConnectionLimit, [&] {
    return std::make_unique<HeldReads<v1::BlobService, v1::ReadResponse>>(
        server_->address(), [&](v1::BlobService::Stub& stub, grpc::ClientContext* context) {
          return stub.Read(context, request);
        });
  });
}

TEST_F(LimitsTest, UploadsAreLimitedForEachConnectionAndInAll) {
  expect_limits("uploads", v1::kUploadsLimit, v1::kUploadsPerConnectionLimit,
                [&] { return std::make_unique<HeldUploads>(server_->address()); });
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
