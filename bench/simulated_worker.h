#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <grpcpp/channel.h>

#include "core/digest.h"
#include "proto/weft/v1/cluster.grpc.pb.h"

namespace weft::bench {

// A job's geometry and a grid of so many cells; every other shard's result is one and the same
// blob.
struct NoOpResults {
  explicit NoOpResults(std::uint32_t cell_count) : cells(cell_count) {}
  [[nodiscard]] std::string of(const v1::TaskSpec& spec) const;
  std::uint32_t cells = 0;
};

// A worker that computes nothing: it exchanges states with a coordinator over real gRPC, and says
// of each shard that it took `work_ms`.
class SimulatedWorker {
 public:
  SimulatedWorker(std::shared_ptr<grpc::Channel> channel, const std::string& id,
                  const NoOpResults& results);

  [[nodiscard]] v1::SynchronizeRequest& request() { return request_; }
  [[nodiscard]] v1::WorkerService::Stub& stub() { return *stub_; }
  // One exchange, in which everything that was assigned before is completed. Throws core::Error
  // when it fails.
  v1::SynchronizeResponse exchange();
  // The next call's number and name.
  void count();
  // Makes what was assigned what the worker runs, to be completed never.
  void hold(const v1::SynchronizeResponse& response);

  std::uint64_t acknowledged_shards = 0;
  std::uint64_t work_ms = 0;  // of each shard, as is said

 private:
  void complete(const v1::Assignment& assignment);
  void store(const std::string& bytes, const core::Digest& digest);

  std::unique_ptr<v1::WorkerService::Stub> stub_;
  std::unique_ptr<v1::BlobService::Stub> blobs_;
  const NoOpResults& results_;
  v1::SynchronizeRequest request_;
  std::string stored_spec_;  // the last one whose result was stored, and the result's digest
  core::Digest stored_;
  std::uint64_t stored_bytes_ = 0;
};

}  // namespace weft::bench
