#pragma once

#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/server.h"
#include "core/clock.h"
#include "core/file.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "tests/coordinator_fabric.h"

namespace weft::coordinator {

// Stands for coordinator::commit: a file that names every result in index order.
inline core::Digest fake_commit(const v1::FabricDescription& description,
                                const std::vector<StageResults>& results,
                                const std::function<std::string(const core::Digest&)>& read_blob,
                                const std::filesystem::path& path) {
  std::string content = v1::canonical_bytes(description);
  for (const StageName name : all_stages()) {
    for (const StageResults& stage : results) {
      for (std::size_t i = 0; stage.name == name && i < stage.shards.size(); ++i) {
        content += core::digest_of(read_blob(stage.shards[i])).hex() + "\n";
      }
    }
  }
  core::write_file_atomically(path, content);
  return core::digest_of(content);
}

// A coordinator on a loopback port, over a folder that outlives it.
class ServiceTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "weft_service_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    start();
  }
  void TearDown() override {
    stop();
    std::filesystem::remove_all(folder_);
  }

  void start() {
    SchedulerOptions options;
    options.state_folder = folder_ / "state";
    options.commit = fake_commit;
    options.queue.retry_ms = 1;
    configure(options);
    scheduler_ = std::make_unique<Scheduler>(std::move(options), core::system_clock());
    server_ = std::make_unique<Server>(*scheduler_, "127.0.0.1:0");
    channel_ = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
    jobs_ = v1::JobService::NewStub(channel_);
    blobs_ = v1::BlobService::NewStub(channel_);
    catalogue_ = v1::CatalogueService::NewStub(channel_);
  }
  virtual void configure(SchedulerOptions& /*options*/) {}
  void stop() {
    server_.reset();
    scheduler_.reset();
  }

  grpc::Status submit(const std::string& request_id, const v1::FabricDescription& description,
                      v1::Job* job = nullptr) {
    grpc::ClientContext context;
    v1::SubmitRequest request;
    request.set_request_id(request_id);
    *request.mutable_description() = description;
    v1::SubmitResponse response;
    const grpc::Status status = jobs_->Submit(&context, request, &response);
    if (job != nullptr) {
      *job = response.job();
    }
    return status;
  }
  v1::Job job(const std::string& id) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::GetJobResponse response;
    EXPECT_TRUE(jobs_->GetJob(&context, request, &response).ok());
    return response.job();
  }
  grpc::Status write(const std::string& data, const core::Digest& digest,
                     v1::WriteResponse* response) {
    grpc::ClientContext context;
    const auto writer = blobs_->Write(&context, response);
    v1::WriteRequest request;
    request.set_digest(digest.binary());
    request.set_size_bytes(data.size());
    writer->Write(request);
    request.Clear();
    for (std::size_t at = 0; at < data.size(); at += 1 << 20) {
      request.set_data(data.substr(at, 1 << 20));
      if (!writer->Write(request)) {
        break;
      }
    }
    writer->WritesDone();
    return writer->Finish();
  }
  grpc::Status read(const core::Digest& digest, std::uint64_t offset, std::string* data) {
    grpc::ClientContext context;
    v1::ReadRequest request;
    request.set_digest(digest.binary());
    request.set_offset(offset);
    const auto reader = blobs_->Read(&context, request);
    v1::ReadResponse response;
    while (reader->Read(&response)) {
      *data += response.data();
    }
    return reader->Finish();
  }

  std::filesystem::path folder_;
  std::unique_ptr<Scheduler> scheduler_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
  std::unique_ptr<v1::BlobService::Stub> blobs_;
  std::unique_ptr<v1::CatalogueService::Stub> catalogue_;
};

// A worker that computes fake results, one exchange at a time.
class FakeWorker {
 public:
  FakeWorker(const std::shared_ptr<grpc::Channel>& channel, const std::string& id)
      : stub_(v1::WorkerService::NewStub(channel)), blobs_(v1::BlobService::NewStub(channel)) {
    request_.set_worker_id(id);
    request_.set_name(id);
    request_.set_threads(2);
    request_.set_fingerprint(core::digest_of("a machine").binary());
    request_.set_free_attempts(1);
    request_.set_wait_ms(2'000);
  }

  [[nodiscard]] v1::SynchronizeRequest& request() { return request_; }

  grpc::Status exchange(v1::SynchronizeResponse* response) {
    grpc::ClientContext context;
    request_.set_sequence(request_.sequence() + 1);
    request_.set_request_id("call-" + std::to_string(request_.sequence()));
    return stub_->Synchronize(&context, request_, response);
  }

  // One exchange; computes what it was given, to be reported with the next one. Whether it was
  // given anything.
  bool work(const std::string& error = "") {
    v1::SynchronizeResponse response;
    const grpc::Status status = exchange(&response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    for (const v1::AttemptName& name : response.acknowledged()) {
      auto& completions = *request_.mutable_completions();
      for (int i = completions.size() - 1; i >= 0; --i) {
        if (completions[i].attempt() == name.attempt()) {
          completions.DeleteSubrange(i, 1);
        }
      }
    }
    for (const v1::Assignment& assignment : response.assignments()) {
      complete(assignment, error);
    }
    return response.assignments_size() > 0;
  }

  std::vector<std::string> log;  // "stage first+count" of each run
  std::uint64_t shards = 0;

 private:
  void complete(const v1::Assignment& assignment, const std::string& error) {
    log.push_back(assignment.stage() + " " + std::to_string(assignment.first_shard()) + "+" +
                  std::to_string(assignment.shards()));
    v1::Completion& completion = *request_.add_completions();
    completion.set_job_id(assignment.name().job_id());
    completion.set_attempt(assignment.name().attempt());
    completion.set_lease_token(assignment.lease_token());
    completion.set_work_ms(10);
    if (!error.empty()) {
      completion.mutable_error()->set_kind(v1::ERROR_KIND_TASK_FAILED);
      completion.mutable_error()->set_shard(assignment.first_shard());
      completion.mutable_error()->set_message(error);
      return;
    }
    for (std::uint64_t i = 0; i < assignment.shards(); ++i) {
      const std::uint64_t shard = assignment.first_shard() + i;
      const std::string bytes = fake_result(assignment.spec(), shard);
      const core::Digest digest = core::digest_of(bytes);
      put(bytes, digest);
      v1::ShardResult& result = *completion.add_results();
      result.set_shard(shard);
      result.set_digest(digest.binary());
      result.set_size_bytes(bytes.size());
      ++shards;
    }
  }

  void put(const std::string& bytes, const core::Digest& digest) {
    grpc::ClientContext context;
    v1::WriteResponse response;
    const auto writer = blobs_->Write(&context, &response);
    v1::WriteRequest request;
    request.set_digest(digest.binary());
    request.set_size_bytes(bytes.size());
    request.set_data(bytes);
    writer->Write(request);
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
  }

  std::unique_ptr<v1::WorkerService::Stub> stub_;
  std::unique_ptr<v1::BlobService::Stub> blobs_;
  v1::SynchronizeRequest request_;
};

}  // namespace weft::coordinator
