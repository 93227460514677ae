#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/services/open_streams.h"
#include "proto/limits.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "storage/blob_uploads.h"

namespace weft::coordinator {

// Results and inputs by digest. A call holds one chunk of its blob in memory, or
// small blobs whole. Contracts: cluster.proto.
class BlobService final : public v1::BlobService::Service {
 public:
  explicit BlobService(Scheduler& scheduler);
  grpc::Status Read(grpc::ServerContext* context, const v1::ReadRequest* request,
                    grpc::ServerWriter<v1::ReadResponse>* writer) override;
  grpc::Status QueryWrite(grpc::ServerContext* context, const v1::QueryWriteRequest* request,
                          v1::QueryWriteResponse* response) override;
  grpc::Status Write(grpc::ServerContext* context, grpc::ServerReader<v1::WriteRequest>* reader,
                     v1::WriteResponse* response) override;
  grpc::Status WriteMany(grpc::ServerContext* context, const v1::WriteManyRequest* request,
                         v1::WriteManyResponse* response) override;

 private:
  // What `store` answers, or why the disk does not take it.
  [[nodiscard]] grpc::Status stored(const std::function<grpc::Status()>& store) const;
  grpc::Status store(v1::WriteRequest& request, grpc::ServerReader<v1::WriteRequest>& reader);
  grpc::Status receive(const core::Digest& digest, v1::WriteRequest& request,
                       grpc::ServerReader<v1::WriteRequest>& reader);
  void sweep_sometimes();

  Scheduler& scheduler_;
  storage::BlobUploads uploads_;
  std::atomic<std::uint64_t> begun_{0};
  OpenStreams reads_{"blob_reads", v1::kBlobReadsLimit, v1::kBlobReadsPerConnectionLimit};
  OpenStreams writes_{"uploads", v1::kUploadsLimit, v1::kUploadsPerConnectionLimit};
};

}  // namespace weft::coordinator
