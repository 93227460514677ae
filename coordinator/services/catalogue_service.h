#pragma once

#include <mutex>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/services/open_streams.h"
#include "proto/limits.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "security/caller.h"

namespace weft::coordinator {

// Published versions. A call holds one chunk of its file in memory. Contracts: cluster.proto.
class CatalogueService final : public v1::CatalogueService::Service {
 public:
  explicit CatalogueService(Scheduler& scheduler)
      : scheduler_(scheduler), catalogue_(scheduler.catalogue()) {}
  grpc::Status ListFabrics(grpc::ServerContext* context, const v1::ListFabricsRequest* request,
                           v1::ListFabricsResponse* response) override;
  grpc::Status ListVersions(grpc::ServerContext* context, const v1::ListVersionsRequest* request,
                            v1::ListVersionsResponse* response) override;
  grpc::Status GetVersion(grpc::ServerContext* context, const v1::GetVersionRequest* request,
                          v1::GetVersionResponse* response) override;
  grpc::Status FetchVersion(grpc::ServerContext* context, const v1::FetchVersionRequest* request,
                            grpc::ServerWriter<v1::FetchVersionResponse>* writer) override;
  grpc::Status GetManifest(grpc::ServerContext* context, const v1::GetManifestRequest* request,
                           v1::GetManifestResponse* response) override;
  grpc::Status ReadPieces(grpc::ServerContext* context, const v1::ReadPiecesRequest* request,
                          grpc::ServerWriter<v1::ReadPiecesResponse>* writer) override;
  grpc::Status TagVersion(grpc::ServerContext* context, const v1::TagVersionRequest* request,
                          v1::TagVersionResponse* response) override;
  grpc::Status RollBack(grpc::ServerContext* context, const v1::RollBackRequest* request,
                        v1::RollBackResponse* response) override;
  grpc::Status ListHistory(grpc::ServerContext* context, const v1::ListHistoryRequest* request,
                           v1::ListHistoryResponse* response) override;
  grpc::Status DiffVersions(grpc::ServerContext* context, const v1::DiffVersionsRequest* request,
                            v1::DiffVersionsResponse* response) override;
  grpc::Status PublishColourway(grpc::ServerContext* context,
                                grpc::ServerReader<v1::PublishColourwayRequest>* reader,
                                v1::PublishColourwayResponse* response) override;
  grpc::Status CollectGarbage(grpc::ServerContext* context,
                              const v1::CollectGarbageRequest* request,
                              v1::CollectGarbageResponse* response) override;

 private:
  [[nodiscard]] static CatalogueOrder order_of(const std::string& request_id,
                                               const security::Caller& caller,
                                               const std::string& comment);

  Scheduler& scheduler_;
  Catalogue& catalogue_;
  OpenStreams fetches_{"fetches", v1::kFetchesLimit, v1::kFetchesPerConnectionLimit};
  OpenStreams colourways_{"colourways", v1::kColourwaysLimit, v1::kColourwaysPerConnectionLimit};
  std::mutex checking_;    // two databases are in memory while a colourway is held against its base
  std::mutex collecting_;  // two collectors at once would only count wrongly
};

}  // namespace weft::coordinator
