#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include "core/digest.h"
#include "proto/weft/v1/cluster.grpc.pb.h"

namespace weft::worker {

// Moves blobs between this worker and the coordinator. While the coordinator is away a call waits
// and tries again, until `should_stop` says so; it then throws core::Error(kCancelled). Any thread.
class BlobClient {
 public:
  // The channel is shared with the other stubs of the process.
  explicit BlobClient(const std::shared_ptr<grpc::Channel>& channel);

  // The blob, checked against its digest. Goes on where a broken stream ended. Throws
  // core::Error(kNotFound) when the coordinator has no such blob, kDataLoss when it is damaged.
  [[nodiscard]] std::string read(const core::Digest& digest,
                                 const std::function<bool()>& should_stop);

  struct Blob {
    core::Digest digest;
    std::string data;
  };
  // Stores blobs with the coordinator: in one call those that may go together (see cluster.proto,
  // WriteMany), or a single one of any size, which goes on where a broken upload ended, or begins
  // again when what is there of it is damaged. Throws core::Error(kResourceExhausted) when it is
  // too large or the coordinator's disk is full.
  void write(const std::vector<Blob>& blobs, const std::function<bool()>& should_stop);

  // Breaks off the calls that run, for a process that ends.
  void close();

 private:
  class Call;

  [[nodiscard]] bool is_closed();
  void write_together(const std::vector<Blob>& blobs, const std::function<bool()>& should_stop);
  void write_in_chunks(const Blob& blob, const std::function<bool()>& should_stop);
  void throw_if_stopped(const std::function<bool()>& should_stop);
  [[nodiscard]] std::optional<std::uint64_t> committed(const core::Digest& digest);
  [[nodiscard]] grpc::Status send(const core::Digest& digest, std::string_view data,
                                  std::uint64_t offset);

  std::unique_ptr<v1::BlobService::Stub> stub_;
  std::mutex mutex_;
  std::set<grpc::ClientContext*> running_;
  bool is_closed_ = false;
};

}  // namespace weft::worker
