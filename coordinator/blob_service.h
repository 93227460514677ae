#pragma once

#include "coordinator/scheduler.h"
#include "proto/weft/v1/cluster.grpc.pb.h"

namespace weft::coordinator {

// Results and inputs by digest. Contracts: cluster.proto.
class BlobService final : public v1::BlobService::Service {
 public:
  explicit BlobService(Scheduler& scheduler) : scheduler_(scheduler) {}
  grpc::Status Read(grpc::ServerContext* context, const v1::ReadRequest* request,
                    grpc::ServerWriter<v1::ReadResponse>* writer) override;
  grpc::Status Write(grpc::ServerContext* context, grpc::ServerReader<v1::WriteRequest>* reader,
                     v1::WriteResponse* response) override;

 private:
  Scheduler& scheduler_;
};

}  // namespace weft::coordinator
