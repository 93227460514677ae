#include "coordinator/catalogue_service.h"

#include <fstream>

#include "coordinator/messages.h"
#include "coordinator/rpc.h"
#include "proto/limits.h"

namespace weft::coordinator {

grpc::Status CatalogueService::ListFabrics(grpc::ServerContext* context,
                                           const v1::ListFabricsRequest* /*request*/,
                                           v1::ListFabricsResponse* response) {
  return answer(*context, "CatalogueService.ListFabrics", [&] {
    for (const VersionRecord& latest : catalogue_.latest_versions()) {
      v1::Fabric& fabric = *response->add_fabrics();
      fabric.set_name(latest.fabric);
      fabric.set_versions(latest.number);  // numbers have no gaps
      *fabric.mutable_latest() = message_of(latest);
    }
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::ListVersions(grpc::ServerContext* context,
                                            const v1::ListVersionsRequest* request,
                                            v1::ListVersionsResponse* response) {
  return answer(*context, "CatalogueService.ListVersions", [&] {
    (void)catalogue_.find(request->fabric() + "@latest");  // says it well when there is none
    for (const VersionRecord& version : catalogue_.versions(request->fabric())) {
      *response->add_versions() = message_of(version);
    }
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
    const std::filesystem::path path = catalogue_.path_of(version);
    std::error_code failure;
    const std::uintmax_t size = std::filesystem::file_size(path, failure);
    std::ifstream file(path, std::ios::binary);
    if (failure || size != version.size_bytes || !file) {
      return {grpc::StatusCode::DATA_LOSS,
              "the file of " + version.fabric + "@" + std::to_string(version.number) +
                  " is gone or damaged in the coordinator's folder; submit the fabric again"};
    }
    if (request->offset() > size) {
      return {grpc::StatusCode::OUT_OF_RANGE,
              "offset is beyond the file's " + std::to_string(size) + " bytes"};
    }
    file.seekg(static_cast<std::streamoff>(request->offset()));
    v1::FetchVersionResponse response;
    *response.mutable_version() = message_of(version);
    std::string chunk(v1::kChunkLimitBytes, '\0');
    std::uint64_t left = size - request->offset();
    do {
      const std::uint64_t count = std::min<std::uint64_t>(left, chunk.size());
      if (!file.read(chunk.data(), static_cast<std::streamsize>(count))) {
        return {grpc::StatusCode::DATA_LOSS, "cannot read " + version.file};
      }
      response.set_data(chunk.data(), count);
      left -= count;
      if (!writer->Write(response)) {
        return {grpc::StatusCode::CANCELLED, "the caller went away"};
      }
      response.clear_version();
    } while (left > 0);
    return grpc::Status::OK;
  });
}

}  // namespace weft::coordinator
