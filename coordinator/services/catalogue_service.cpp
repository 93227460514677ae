#include "coordinator/services/catalogue_service.h"

#include "coordinator/scheduler/listings.h"
#include "coordinator/scheduler/messages.h"
#include "coordinator/services/rpc.h"
#include "core/clock.h"
#include "core/error.h"
#include "proto/limits.h"

namespace weft::coordinator {

// Checks what any order must have.
CatalogueOrder CatalogueService::order_of(const std::string& request_id,
                                          const security::Caller& caller,
                                          const std::string& comment) {
  check_id(request_id, "request_id");
  if (comment.size() > v1::kCommentLimitBytes) {
    throw core::Error(core::Code::kInvalidArgument, "comment is longer than 1024 bytes");
  }
  const std::string user = caller.user.empty() ? "nobody" : caller.user;
  return {request_id, user, comment, to_ms(core::system_clock().now())};
}

grpc::Status CatalogueService::ListFabrics(grpc::ServerContext* context,
                                           const v1::ListFabricsRequest* /*request*/,
                                           v1::ListFabricsResponse* response) {
  return answer(*context, "CatalogueService.ListFabrics", [&] {
    *response = list_fabrics(catalogue_);
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::ListVersions(grpc::ServerContext* context,
                                            const v1::ListVersionsRequest* request,
                                            v1::ListVersionsResponse* response) {
  return answer(*context, "CatalogueService.ListVersions", [&] {
    *response = list_versions(catalogue_, request->fabric());
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::GetVersion(grpc::ServerContext* context,
                                          const v1::GetVersionRequest* request,
                                          v1::GetVersionResponse* response) {
  return answer(*context, "CatalogueService.GetVersion", [&] {
    *response->mutable_version() = message_of(catalogue_.find(request->reference()));
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::FetchVersion(grpc::ServerContext* context,
                                            const v1::FetchVersionRequest* request,
                                            grpc::ServerWriter<v1::FetchVersionResponse>* writer) {
  return answer(*context, "CatalogueService.FetchVersion", [&]() -> grpc::Status {
    const OpenStreams::Ticket ticket = fetches_.enter(*context);
    const VersionRecord version = catalogue_.find(request->reference());
    if (request->offset() > version.size_bytes) {
      return {grpc::StatusCode::OUT_OF_RANGE,
              "offset is beyond the file's " + std::to_string(version.size_bytes) + " bytes"};
    }
    v1::FetchVersionResponse response;
    *response.mutable_version() = message_of(version);
    bool is_heard = true;
    if (request->offset() == version.size_bytes) {
      is_heard = writer->Write(response);
    }
    catalogue_.read(version, request->offset(), [&](std::string_view bytes) {
      response.set_data(bytes.data(), bytes.size());
      is_heard = writer->Write(response);
      response.clear_version();
      return is_heard;
    });
    return is_heard ? grpc::Status::OK
                    : grpc::Status(grpc::StatusCode::CANCELLED, "the caller went away");
  });
}

grpc::Status CatalogueService::GetManifest(grpc::ServerContext* context,
                                           const v1::GetManifestRequest* request,
                                           v1::GetManifestResponse* response) {
  return answer(*context, "CatalogueService.GetManifest", [&] {
    const VersionRecord version = catalogue_.find(request->reference());
    *response->mutable_version() = message_of(version);
    for (const storage::Piece& piece : catalogue_.pieces_of(version)) {
      v1::Piece& message = *response->add_pieces();
      message.set_digest(piece.digest.binary());
      message.set_size_bytes(piece.size_bytes);
    }
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::ReadPieces(grpc::ServerContext* context,
                                          const v1::ReadPiecesRequest* request,
                                          grpc::ServerWriter<v1::ReadPiecesResponse>* writer) {
  return answer(*context, "CatalogueService.ReadPieces", [&]() -> grpc::Status {
    const OpenStreams::Ticket ticket = fetches_.enter(*context);
    if (request->digests_size() > v1::kPiecesLimit) {
      return {grpc::StatusCode::RESOURCE_EXHAUSTED,
              "digests names " + std::to_string(request->digests_size()) +
                  " pieces; the limit of pieces in a call is " + std::to_string(v1::kPiecesLimit)};
    }
    v1::ReadPiecesResponse response;
    for (const std::string& digest : request->digests()) {
      response.set_data(catalogue_.read_piece(digest_from(digest, "digests")));
      if (!writer->Write(response)) {
        return {grpc::StatusCode::CANCELLED, "the caller went away"};
      }
    }
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::TagVersion(grpc::ServerContext* context,
                                          const v1::TagVersionRequest* request,
                                          v1::TagVersionResponse* response) {
  return answer(*context, "CatalogueService.TagVersion", [&](const security::Caller& caller) {
    const CatalogueOrder order = order_of(request->request_id(), caller, "");
    *response->mutable_version() = message_of(
        request->reference().empty() ? catalogue_.untag(request->fabric(), request->tag(), order)
                                     : catalogue_.tag(request->reference(), request->tag(), order));
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::RollBack(grpc::ServerContext* context,
                                        const v1::RollBackRequest* request,
                                        v1::RollBackResponse* response) {
  return answer(*context, "CatalogueService.RollBack", [&](const security::Caller& caller) {
    const CatalogueOrder order = order_of(request->request_id(), caller, request->comment());
    *response->mutable_version() = message_of(catalogue_.roll_back(request->reference(), order));
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::ListHistory(grpc::ServerContext* context,
                                           const v1::ListHistoryRequest* request,
                                           v1::ListHistoryResponse* response) {
  return answer(*context, "CatalogueService.ListHistory", [&] {
    *response = list_history(catalogue_, request->fabric(), request->limit());
    return grpc::Status::OK;
  });
}

}  // namespace weft::coordinator
