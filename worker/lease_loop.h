#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include "core/clock.h"
#include "core/digest.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "worker/attempt_table.h"
#include "worker/blob_client.h"
#include "worker/input_cache.h"
#include "worker/outbox.h"
#include "worker/stage_bakers.h"

namespace weft::worker {

struct WorkerOptions {
  std::string name;  // for people
  unsigned threads = 1;
  std::uint64_t memory_bytes = 0;
  std::filesystem::path scratch;  // inputs are kept here
  std::uint64_t scratch_limit_bytes = std::uint64_t{4} << 30;
};

// A worker's life: it says what it runs and is told what to run (WorkerService.Synchronize),
// computes shards on its threads, stores their results, and repeats what it has completed until
// that is acknowledged. While the coordinator is away it computes what it has and keeps the
// results: they are taken from any attempt whose shards are still unfinished.
class LeaseLoop {
 public:
  LeaseLoop(WorkerOptions options, const std::shared_ptr<grpc::Channel>& channel);

  // Works until `should_leave` says so, then begins nothing more, reports what is done and returns,
  // after some seconds at the latest. Throws core::Error when the coordinator refuses this worker.
  void run(const std::function<bool()>& should_leave);

 private:
  void synchronize();
  [[nodiscard]] v1::SynchronizeRequest next_request(grpc::ClientContext& context);
  void apply(const v1::SynchronizeResponse& response);
  void pause(std::uint32_t for_ms);

  void compute();
  void bake(const ShardClaim& claim);
  void fail(const ShardClaim& claim, v1::ErrorKind kind, const std::string& message);
  void upload();
  void upload(const OutboxItem& item);
  void tell_news();
  void begin_leaving();

  const WorkerOptions options_;
  const std::string id_;
  const core::Digest fingerprint_;
  std::unique_ptr<v1::WorkerService::Stub> stub_;
  BlobClient blobs_;
  InputCache inputs_;
  StageBakers bakers_;
  Outbox outbox_;

  std::mutex mutex_;
  std::condition_variable changed_;
  AttemptTable table_;                           // guarded by mutex_
  grpc::ClientContext* waiting_call_ = nullptr;  // guarded by mutex_
  std::uint32_t free_told_ = 0;   // guarded by mutex_: free_attempts of the last request
  bool has_news_ = false;         // guarded by mutex_
  bool has_left_ = false;         // guarded by mutex_
  std::exception_ptr failure_;    // guarded by mutex_
  std::uint32_t wait_ms_ = 1000;  // of the synchronizing thread alone
  std::uint64_t sequence_ = 0;    // of the synchronizing thread alone
  std::atomic<bool> is_leaving_{false};
  std::atomic<bool> is_giving_up_{false};  // leaving took too long, or the coordinator refused us
};

}  // namespace weft::worker
