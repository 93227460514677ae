#include "coordinator/blob_service.h"

#include <algorithm>

#include "coordinator/rpc.h"
#include "proto/limits.h"

namespace weft::coordinator {

grpc::Status BlobService::Read(grpc::ServerContext* context, const v1::ReadRequest* request,
                               grpc::ServerWriter<v1::ReadResponse>* writer) {
  return answer(*context, "BlobService.Read", [&]() -> grpc::Status {
    const core::Digest digest = digest_from(request->digest(), "digest");
    const bool was_there = scheduler_.blobs().has(digest);
    const std::optional<std::string> blob = scheduler_.blobs().get(digest);
    if (!blob) {
      scheduler_.result_lost(digest);
      return was_there
                 ? grpc::Status(grpc::StatusCode::DATA_LOSS, "blob " + digest.hex() +
                                                                 " was damaged on disk; whatever "
                                                                 "made it will be computed again")
                 : grpc::Status(grpc::StatusCode::NOT_FOUND, "no blob " + digest.hex());
    }
    if (request->offset() > blob->size()) {
      return {grpc::StatusCode::OUT_OF_RANGE,
              "offset is beyond the blob's " + std::to_string(blob->size()) + " bytes"};
    }
    v1::ReadResponse response;
    response.set_size_bytes(blob->size());
    std::size_t at = request->offset();
    do {
      const std::size_t count = std::min(v1::kChunkLimitBytes, blob->size() - at);
      response.set_data(blob->data() + at, count);
      at += count;
      if (!writer->Write(response)) {
        return {grpc::StatusCode::CANCELLED, "the caller went away"};
      }
      response.clear_size_bytes();
    } while (at < blob->size());
    return grpc::Status::OK;
  });
}

grpc::Status BlobService::Write(grpc::ServerContext* context,
                                grpc::ServerReader<v1::WriteRequest>* reader,
                                v1::WriteResponse* /*response*/) {
  return answer(*context, "BlobService.Write", [&]() -> grpc::Status {
    v1::WriteRequest request;
    if (!reader->Read(&request)) {
      return {grpc::StatusCode::INVALID_ARGUMENT, "the stream has no message"};
    }
    const core::Digest digest = digest_from(request.digest(), "digest");
    const std::uint64_t size = request.size_bytes();
    if (size > v1::kBlobLimitBytes) {
      return {grpc::StatusCode::RESOURCE_EXHAUSTED,
              "the blob has " + std::to_string(size) + " bytes; the limit is 1 GiB"};
    }
    if (scheduler_.blobs().has(digest)) {
      return grpc::Status::OK;
    }
    std::string data;
    do {
      if (request.data().size() > v1::kChunkLimitBytes) {
        return {grpc::StatusCode::INVALID_ARGUMENT, "a chunk is larger than 1 MiB"};
      }
      data += request.data();
      if (data.size() > size) {
        return {grpc::StatusCode::DATA_LOSS, "more bytes came than were announced"};
      }
    } while (reader->Read(&request));
    if (data.size() != size || core::digest_of(data) != digest) {
      return {grpc::StatusCode::DATA_LOSS,
              "the bytes are not those of blob " + digest.hex() + "; nothing was stored"};
    }
    scheduler_.blobs().put(data);
    return grpc::Status::OK;
  });
}

}  // namespace weft::coordinator
