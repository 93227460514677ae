#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include "core/digest.h"
#include "proto/weft/v1/cluster.grpc.pb.h"

namespace weft::worker {

// A coordinator that says what the test tells it to, keeps blobs and logs in memory, and remembers
// what it was told.
class FakeCoordinator : public v1::WorkerService::Service, public v1::BlobService::Service {
 public:
  FakeCoordinator() {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(static_cast<v1::WorkerService::Service*>(this));
    builder.RegisterService(static_cast<v1::BlobService::Service*>(this));
    server_ = builder.BuildAndStart();
    channel_ = grpc::CreateChannel("127.0.0.1:" + std::to_string(port),
                                   grpc::InsecureChannelCredentials());
  }
  ~FakeCoordinator() override {
    server_->Shutdown();
    server_->Wait();
  }
  FakeCoordinator(const FakeCoordinator&) = delete;
  FakeCoordinator& operator=(const FakeCoordinator&) = delete;
  FakeCoordinator(FakeCoordinator&&) = delete;
  FakeCoordinator& operator=(FakeCoordinator&&) = delete;

  [[nodiscard]] const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }

  // Comes with one of the next answers.
  void say(const v1::SynchronizeResponse& response) {
    const std::lock_guard lock(mutex_);
    to_say_.push_back(response);
    changed_.notify_all();
  }
  // Blobs are not taken until further notice: as by one that is away, or has no room for them.
  void refuse_blobs(bool is_refused, grpc::StatusCode why = grpc::StatusCode::UNAVAILABLE) {
    const std::lock_guard lock(mutex_);
    refusal_ = is_refused ? why : grpc::StatusCode::OK;
  }

  // The requests so far, and further ones until `is_it` holds for one of them; that one, or an
  // empty one when a long time has passed.
  v1::SynchronizeRequest wait_for(const std::function<bool(const v1::SynchronizeRequest&)>& is_it) {
    std::unique_lock lock(mutex_);
    v1::SynchronizeRequest found;
    std::size_t seen = 0;
    changed_.wait_for(lock, std::chrono::seconds(30), [&] {
      for (; seen < requests_.size(); ++seen) {
        if (is_it(requests_[seen])) {
          found = requests_[seen];
          return true;
        }
      }
      return false;
    });
    return found;
  }
  [[nodiscard]] std::string log_of(std::uint64_t attempt) {
    const std::lock_guard lock(mutex_);
    return logs_[attempt];
  }
  [[nodiscard]] bool wait_for_log(std::uint64_t attempt, const std::string& text) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(30),
                             [&] { return logs_[attempt].find(text) != std::string::npos; });
  }
  [[nodiscard]] bool has_blob(const core::Digest& digest) {
    const std::lock_guard lock(mutex_);
    return blobs_.contains(digest.binary());
  }

  grpc::Status Synchronize(grpc::ServerContext* context, const v1::SynchronizeRequest* request,
                           v1::SynchronizeResponse* response) override {
    std::unique_lock lock(mutex_);
    requests_.push_back(*request);
    changed_.notify_all();
    const auto deadline = std::chrono::milliseconds(std::min(request->wait_ms(), 300U));
    const bool has_more = request->completions_size() > 0;
    for (const v1::Completion& completion : request->completions()) {
      v1::AttemptName& name = *response->add_acknowledged();
      name.set_job_id(completion.job_id());
      name.set_attempt(completion.attempt());
    }
    changed_.wait_for(lock, deadline,
                      [&] { return has_more || !to_say_.empty() || context->IsCancelled(); });
    if (!to_say_.empty() && !context->IsCancelled()) {
      response->MergeFrom(to_say_.front());
      to_say_.pop_front();
    }
    return grpc::Status::OK;
  }

  grpc::Status AppendLog(grpc::ServerContext* /*context*/, const v1::AppendLogRequest* request,
                         v1::AppendLogResponse* response) override {
    const std::lock_guard lock(mutex_);
    std::string& log = logs_[request->attempt()];
    if (request->offset() > log.size()) {
      return {grpc::StatusCode::OUT_OF_RANGE, "beyond the end"};
    }
    const std::size_t known = log.size() - request->offset();
    log += request->text().size() > known ? request->text().substr(known) : "";
    response->set_size_bytes(log.size());
    changed_.notify_all();
    return grpc::Status::OK;
  }

  grpc::Status Read(grpc::ServerContext* /*context*/, const v1::ReadRequest* request,
                    grpc::ServerWriter<v1::ReadResponse>* writer) override {
    const std::lock_guard lock(mutex_);
    const auto found = blobs_.find(request->digest());
    if (found == blobs_.end()) {
      return {grpc::StatusCode::NOT_FOUND, "no such blob"};
    }
    v1::ReadResponse response;
    response.set_data(found->second.substr(request->offset()));
    writer->Write(response);
    return grpc::Status::OK;
  }

  grpc::Status WriteMany(grpc::ServerContext* /*context*/, const v1::WriteManyRequest* request,
                         v1::WriteManyResponse* /*response*/) override {
    const std::lock_guard lock(mutex_);
    if (refusal_ != grpc::StatusCode::OK) {
      return {refusal_, "not now"};
    }
    for (const v1::WholeBlob& blob : request->blobs()) {
      blobs_[blob.digest()] = blob.data();
    }
    changed_.notify_all();
    return grpc::Status::OK;
  }

  grpc::Status Write(grpc::ServerContext* /*context*/, grpc::ServerReader<v1::WriteRequest>* reader,
                     v1::WriteResponse* /*response*/) override {
    v1::WriteRequest request;
    std::string digest;
    std::string data;
    while (reader->Read(&request)) {
      digest += request.digest();
      data += request.data();
    }
    const std::lock_guard lock(mutex_);
    if (refusal_ != grpc::StatusCode::OK) {
      return {refusal_, "not now"};
    }
    if (core::digest_of(data).binary() != digest) {
      return {grpc::StatusCode::DATA_LOSS, "other bytes"};
    }
    blobs_[digest] = data;
    changed_.notify_all();
    return grpc::Status::OK;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<v1::SynchronizeResponse> to_say_;
  std::vector<v1::SynchronizeRequest> requests_;
  std::map<std::string, std::string> blobs_;
  std::map<std::uint64_t, std::string> logs_;
  grpc::StatusCode refusal_ = grpc::StatusCode::OK;
  std::unique_ptr<grpc::Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
};

}  // namespace weft::worker
