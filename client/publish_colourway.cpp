#include "client/publish_colourway.h"

#include <fstream>
#include <string>
#include <utility>

#include "client/fetch_pieces.h"
#include "core/error.h"
#include "proto/limits.h"

namespace weft::client {

namespace {

v1::PublishColourwayRequest claim_of(const ColourwayOffer& offer) {
  v1::PublishColourwayRequest request;
  request.set_request_id(new_request_id());
  request.set_fabric(offer.fabric);
  request.set_base(offer.base);
  request.set_comment(offer.comment);
  request.set_content_digest(offer.content_digest.binary());
  request.set_size_bytes(std::filesystem::file_size(offer.file));
  return request;
}

grpc::Status send(Coordinator& coordinator, const std::filesystem::path& path,
                  const v1::PublishColourwayRequest& claim, v1::Version& version) {
  std::ifstream file(path, std::ios::binary);
  grpc::ClientContext context;
  set_deadline(context, claim.size_bytes());
  v1::PublishColourwayResponse response;
  const auto writer = coordinator.catalogue().PublishColourway(&context, &response);
  v1::PublishColourwayRequest request = claim;
  bool is_heard = writer->Write(request);  // else the coordinator has answered already
  std::string chunk(v1::kChunkLimitBytes, '\0');
  while (is_heard && file) {
    file.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
    request.Clear();
    request.set_data(chunk.data(), static_cast<std::size_t>(file.gcount()));
    is_heard = writer->Write(request);
  }
  writer->WritesDone();
  grpc::Status status = writer->Finish();
  version = std::move(*response.mutable_version());
  return status;
}

}  // namespace

v1::Version publish_colourway(Coordinator& coordinator, const ColourwayOffer& offer) {
  const std::string doing = "publish a colourway of " + offer.base;
  const v1::PublishColourwayRequest claim = claim_of(offer);
  Patience patience(coordinator, doing);
  v1::Version version;
  for (grpc::Status status = send(coordinator, offer.file, claim, version); !status.ok();
       status = send(coordinator, offer.file, claim, version)) {
    if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED) {
      throw core::Error(core::Code::kFailedPrecondition,
                        "the coordinator at " + coordinator.address() +
                            " is older than this weft and takes no colourways; write a file with "
                            "-o FILE.h5, or have the light traced there with --exact");
    }
    patience.wait(status, false);
  }
  return version;
}

}  // namespace weft::client
