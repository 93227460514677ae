#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include "core/clock.h"
#include "core/digest.h"
#include "core/error.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "worker/attempt_table.h"
#include "worker/baker.h"
#include "worker/blob_client.h"
#include "worker/input_cache.h"
#include "worker/log_sender.h"
#include "worker/spool.h"
#include "worker/stage_bakers.h"

namespace weft::worker {

struct WorkerOptions {
  std::string name;  // for people
  unsigned threads = 1;
  std::uint64_t memory_bytes = 0;
  std::vector<std::string> labels;
  std::string coordinator;        // its address: what is left for another is not ours to report
  std::filesystem::path scratch;  // inputs and unacknowledged results are kept here
  std::uint64_t scratch_limit_bytes = std::uint64_t{4} << 30;  // of inputs
  std::uint64_t spool_limit_bytes = std::uint64_t{1} << 30;    // of results that are not uploaded
  double wall_limit_seconds = 0;  // ends by itself before it has run for so long; 0: never
  double idle_limit_seconds = 0;  // ends when it had nothing to do for so long; 0: never
  double hung_seconds = 30;       // a thread that does not stop for so long is given up
  StageBakers::Maker make_baker = worker::make_baker;
  // Asked when the coordinator does not answer: why no connection comes about, empty when that is
  // not known.
  std::function<std::string()> connection_problem;
  // Ends the process at once, with this exit code: threads that do not return make an orderly end
  // impossible. Everything that can be saved is. When it returns, run() waits for them.
  std::function<void(int code)> end_process;
};

// A worker's life: it says what it runs and is told what to run (WorkerService.Synchronize),
// computes shards on its threads, stores their results, and repeats what it has completed until
// that is acknowledged. What is not acknowledged is in the scratch folder (spool.h), for whoever
// comes after this process. While the coordinator is away it computes what it has and keeps the
// results: they are taken from any attempt whose shards are still unfinished.
class LeaseLoop {
 public:
  // Throws core::Error(kUnavailable) when the scratch folder cannot be used.
  LeaseLoop(WorkerOptions options, const std::shared_ptr<grpc::Channel>& channel);

  // Works until `should_leave` says so or a limit is reached, then begins nothing more, reports
  // what is done and returns, after some seconds at the latest. Throws core::Error when the
  // coordinator refuses this worker.
  void run(const std::function<bool()>& should_leave);

 private:
  // A thread that computes, and what it has in hand. Guarded by mutex_.
  struct Seat {
    std::optional<ShardClaim> claim;
    std::optional<core::Stopwatch> since_stop;  // since it was first seen not to stop
    bool is_given_up = false;                   // the claim was ended without its thread
  };
  struct Baked {
    std::string bytes;
    double seconds = 0;
  };

  // synchronizing (lease_loop.cpp)
  void synchronize();
  [[nodiscard]] v1::SynchronizeRequest next_request(grpc::ClientContext& context);
  void apply(const v1::SynchronizeResponse& response);
  void pause(std::uint32_t for_ms);
  void tell_news();
  void forget_what_is_over();
  void begin_leaving(const char* why);
  void finish_up();
  [[nodiscard]] const char* reason_to_leave(const std::function<bool()>& should_leave);
  [[nodiscard]] double wall_left_seconds() const;

  // computing (lease_loop_shards.cpp)
  void compute(Seat& seat);
  [[nodiscard]] std::optional<ShardClaim> next_claim(Seat& seat);
  [[nodiscard]] bool leave(Seat& seat);
  void bake(Seat& seat, const ShardClaim& claim);
  [[nodiscard]] Baked baked(const ShardClaim& claim, const std::function<bool()>& should_stop);
  void store(const ShardClaim& claim, const Baked& baked, const std::function<bool()>& should_stop);
  void give_up(const ShardClaim& claim);
  void fail(const ShardClaim& claim, v1::ErrorKind kind, const std::string& message);
  void upload();
  void upload(std::vector<SpoolItem> items);
  [[nodiscard]] std::vector<BlobClient::Blob> read_spooled(std::vector<SpoolItem>& items);
  void deliver(const std::vector<BlobClient::Blob>& blobs);
  void drop(const SpoolItem& item, const core::Error& why);
  void note_uploaded(const SpoolItem& item);
  void set_undelivered(const std::string& why);

  // housekeeping (lease_loop_house.cpp)
  void keep_house();
  void take_over_orphans();
  void watch_seats();
  [[nodiscard]] bool wait_for_seats(double seconds);

  const WorkerOptions options_;
  const std::string id_;
  const core::Digest fingerprint_;
  const core::Stopwatch since_start_;
  std::unique_ptr<v1::WorkerService::Stub> stub_;
  BlobClient blobs_;
  InputCache inputs_;
  StageBakers bakers_;
  Spool spool_;
  LogSender logs_;

  std::mutex mutex_;
  std::condition_variable changed_;
  AttemptTable table_;                           // guarded by mutex_
  std::vector<Seat> seats_;                      // their content is guarded by mutex_
  unsigned stuck_ = 0;                           // guarded by mutex_: seats given up
  grpc::ClientContext* waiting_call_ = nullptr;  // guarded by mutex_
  std::uint32_t free_told_ = 0;   // guarded by mutex_: free_attempts of the last request
  bool has_news_ = false;         // guarded by mutex_
  bool has_left_ = false;         // guarded by mutex_
  core::Stopwatch since_busy_;    // guarded by mutex_
  std::exception_ptr failure_;    // guarded by mutex_
  std::uint32_t wait_ms_ = 1000;  // of the synchronizing thread alone
  std::uint64_t sequence_ = 0;    // of the synchronizing thread alone
  std::atomic<bool> is_leaving_{false};
  std::atomic<bool> is_giving_up_{false};  // leaving took too long, or the coordinator refused us
};

}  // namespace weft::worker
