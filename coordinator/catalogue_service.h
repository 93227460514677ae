#pragma once

#include "coordinator/catalogue.h"
#include "coordinator/open_streams.h"
#include "proto/limits.h"
#include "proto/weft/v1/cluster.grpc.pb.h"

namespace weft::coordinator {

// Published versions. Contracts: cluster.proto.
class CatalogueService final : public v1::CatalogueService::Service {
 public:
  explicit CatalogueService(const Catalogue& catalogue) : catalogue_(catalogue) {}
  grpc::Status ListFabrics(grpc::ServerContext* context, const v1::ListFabricsRequest* request,
                           v1::ListFabricsResponse* response) override;
  grpc::Status ListVersions(grpc::ServerContext* context, const v1::ListVersionsRequest* request,
                            v1::ListVersionsResponse* response) override;
  grpc::Status GetVersion(grpc::ServerContext* context, const v1::GetVersionRequest* request,
                          v1::GetVersionResponse* response) override;
  grpc::Status FetchVersion(grpc::ServerContext* context, const v1::FetchVersionRequest* request,
                            grpc::ServerWriter<v1::FetchVersionResponse>* writer) override;

 private:
  const Catalogue& catalogue_;
  OpenStreams fetches_{"fetches", v1::kFetchesLimit, v1::kFetchesPerConnectionLimit};
};

}  // namespace weft::coordinator
