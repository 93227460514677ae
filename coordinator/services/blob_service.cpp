#include "coordinator/services/blob_service.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>

#include "coordinator/scheduler/messages.h"
#include "coordinator/services/rpc.h"
#include "core/clock.h"
#include "core/error.h"
#include "proto/limits.h"
#include "storage/blob_reader.h"

namespace weft::coordinator {

namespace {

constexpr std::uint64_t kUploadsBetweenSweeps = 256;

grpc::Status send(storage::BlobReader& blob, std::uint64_t offset,
                  grpc::ServerWriter<v1::ReadResponse>& writer) {
  blob.skip(offset);
  v1::ReadResponse response;
  response.set_size_bytes(blob.size_bytes());
  do {
    *response.mutable_data() = blob.read(v1::kChunkLimitBytes);
    if (!writer.Write(response)) {
      return {grpc::StatusCode::CANCELLED, "the caller went away"};
    }
    response.clear_size_bytes();
  } while (!blob.is_over());
  return grpc::Status::OK;
}

}  // namespace

BlobService::BlobService(Scheduler& scheduler)
    : scheduler_(scheduler), uploads_(scheduler.blobs()) {
  sweep_sometimes();
}

void BlobService::sweep_sometimes() {
  if (begun_++ % kUploadsBetweenSweeps == 0) {
    const std::int64_t now_ms = to_ms(core::system_clock().now());
    uploads_.sweep(now_ms - storage::UploadLimits().kept_ms);
  }
}

grpc::Status BlobService::Read(grpc::ServerContext* context, const v1::ReadRequest* request,
                               grpc::ServerWriter<v1::ReadResponse>* writer) {
  return answer(*context, "BlobService.Read", [&]() -> grpc::Status {
    const OpenStreams::Ticket ticket = reads_.enter(*context);
    const core::Digest digest = digest_from(request->digest(), "digest");
    std::optional<storage::BlobReader> blob = storage::BlobReader::open(scheduler_.blobs(), digest);
    if (!blob) {
      scheduler_.result_lost(digest);
      return {grpc::StatusCode::NOT_FOUND, "no blob " + digest.hex()};
    }
    if (request->offset() > blob->size_bytes()) {
      return {grpc::StatusCode::OUT_OF_RANGE,
              "offset is beyond the blob's " + std::to_string(blob->size_bytes()) + " bytes"};
    }
    try {
      return send(*blob, request->offset(), *writer);
    } catch (const core::Error& error) {
      if (error.code() == core::Code::kDataLoss) {
        scheduler_.result_lost(digest);
      }
      throw;
    }
  });
}

grpc::Status BlobService::QueryWrite(grpc::ServerContext* context,
                                     const v1::QueryWriteRequest* request,
                                     v1::QueryWriteResponse* response) {
  return answer(*context, "BlobService.QueryWrite", [&]() -> grpc::Status {
    const core::Digest digest = digest_from(request->digest(), "digest");
    const std::optional<std::uint64_t> size_bytes = scheduler_.blobs().use(digest);
    response->set_complete(size_bytes.has_value());
    response->set_committed_bytes(size_bytes ? *size_bytes : uploads_.committed_bytes(digest));
    return grpc::Status::OK;
  });
}

grpc::Status BlobService::Write(grpc::ServerContext* context,
                                grpc::ServerReader<v1::WriteRequest>* reader,
                                v1::WriteResponse* /*response*/) {
  return answer(*context, "BlobService.Write", [&]() -> grpc::Status {
    const OpenStreams::Ticket ticket = writes_.enter(*context);
    v1::WriteRequest request;
    if (!reader->Read(&request)) {
      return {grpc::StatusCode::INVALID_ARGUMENT, "the stream has no message"};
    }
    return stored([&] { return store(request, *reader); });
  });
}

grpc::Status BlobService::WriteMany(grpc::ServerContext* context,
                                    const v1::WriteManyRequest* request,
                                    v1::WriteManyResponse* /*response*/) {
  return answer(*context, "BlobService.WriteMany", [&]() -> grpc::Status {
    const OpenStreams::Ticket ticket = writes_.enter(*context);
    std::vector<core::Digest> digests;
    std::size_t bytes = 0;
    for (const v1::WholeBlob& blob : request->blobs()) {
      digests.push_back(digest_from(blob.digest(), "digest"));
      bytes += blob.data().size();
      if (blob.data().size() > v1::kChunkLimitBytes || bytes > v1::kBatchLimitBytes) {
        return {grpc::StatusCode::INVALID_ARGUMENT,
                "blobs of over 1 MiB, or over 4 MiB together, go to Write"};
      }
    }
    for (int i = 0; i < request->blobs_size(); ++i) {
      if (core::digest_of(request->blobs(i).data()) != digests[static_cast<std::size_t>(i)]) {
        return {grpc::StatusCode::DATA_LOSS, "the bytes are not those of blob " +
                                                 digests[static_cast<std::size_t>(i)].hex() +
                                                 "; nothing was stored"};
      }
    }
    return stored([&] {
      storage::BlobStore::Batch batch(scheduler_.blobs());
      for (int i = 0; i < request->blobs_size(); ++i) {
        batch.put(digests[static_cast<std::size_t>(i)], request->blobs(i).data());
      }
      batch.commit();
      return grpc::Status::OK;
    });
  });
}

grpc::Status BlobService::stored(const std::function<grpc::Status()>& store) const {
  try {
    return store();
  } catch (const core::Error& error) {
    // What the disk does not take is a short resource to the worker, which would try for ever
    // after UNAVAILABLE. When the coordinator ends, the worker keeps it for the next one.
    const bool is_disk =
        error.code() == core::Code::kUnavailable || error.code() == core::Code::kResourceExhausted;
    if (!is_disk) {
      throw;
    }
    spdlog::warn("event=blob_not_stored message=\"{}\"", error.what());
    const bool is_ending = scheduler_.fatal_problem().has_value();
    throw core::Error(is_ending ? core::Code::kUnavailable : core::Code::kResourceExhausted,
                      std::string("the coordinator cannot store a blob: ") + error.what());
  }
}

grpc::Status BlobService::store(v1::WriteRequest& request,
                                grpc::ServerReader<v1::WriteRequest>& reader) {
  const core::Digest digest = digest_from(request.digest(), "digest");
  if (request.size_bytes() > v1::kBlobLimitBytes) {
    return {grpc::StatusCode::RESOURCE_EXHAUSTED, "blob_bytes_limit: the blob has " +
                                                      std::to_string(request.size_bytes()) +
                                                      " bytes; the limit is 1 GiB"};
  }
  // One of another size is damaged, and is replaced.
  if (scheduler_.blobs().use(digest) == request.size_bytes()) {
    return grpc::Status::OK;
  }
  return receive(digest, request, reader);
}

grpc::Status BlobService::receive(const core::Digest& digest, v1::WriteRequest& request,
                                  grpc::ServerReader<v1::WriteRequest>& reader) {
  sweep_sometimes();
  const std::uint64_t offset = request.offset();
  if (offset != 0 &&
      (offset != uploads_.committed_bytes(digest) || offset > request.size_bytes())) {
    return {grpc::StatusCode::OUT_OF_RANGE, "the upload may begin at 0 or go on at " +
                                                std::to_string(uploads_.committed_bytes(digest)) +
                                                ", not at " + std::to_string(offset)};
  }
  const std::unique_ptr<storage::BlobUpload> upload =
      uploads_.begin(digest, request.size_bytes(), offset);
  if (upload == nullptr) {
    return {grpc::StatusCode::ABORTED,
            "another upload of blob " + digest.hex() + " is under way; ask QueryWrite in a while"};
  }
  do {
    if (request.data().size() > v1::kChunkLimitBytes) {
      return {grpc::StatusCode::INVALID_ARGUMENT, "a chunk is larger than 1 MiB"};
    }
    upload->add(request.data());
  } while (reader.Read(&request));
  upload->finish();
  return grpc::Status::OK;
}

}  // namespace weft::coordinator
