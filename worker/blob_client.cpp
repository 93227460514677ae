#include "worker/blob_client.h"

#include <algorithm>
#include <chrono>

#include "core/error.h"
#include "proto/limits.h"
#include "proto/status.h"
#include "worker/back_off.h"

namespace weft::worker {

namespace {

constexpr std::chrono::seconds kAllowance{30};
constexpr std::uint64_t kSlowestBytesPerSecond = 1'000'000;

void set_deadline(grpc::ClientContext& context, std::uint64_t size_bytes) {
  const auto allowance = kAllowance + std::chrono::seconds(size_bytes / kSlowestBytesPerSecond);
  context.set_deadline(gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC),
                                    gpr_time_from_seconds(allowance.count(), GPR_TIMESPAN)));
}

bool is_away(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::UNAVAILABLE ||
         status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
}

}  // namespace

BlobClient::BlobClient(const std::shared_ptr<grpc::Channel>& channel)
    : stub_(v1::BlobService::NewStub(channel)) {}

std::string BlobClient::read(const core::Digest& digest, const std::function<bool()>& should_stop) {
  std::string data;
  BackOff back_off;
  while (true) {
    v1::ReadRequest request;
    request.set_digest(digest.binary());
    request.set_offset(data.size());
    grpc::ClientContext context;
    set_deadline(context, v1::kBlobLimitBytes);
    const auto reader = stub_->Read(&context, request);
    v1::ReadResponse response;
    while (reader->Read(&response)) {
      data += response.data();
      back_off.reset();
      if (data.size() > v1::kBlobLimitBytes || should_stop()) {
        context.TryCancel();
      }
    }
    const grpc::Status status = reader->Finish();
    if (status.ok()) {
      break;
    }
    if (should_stop()) {
      throw core::Error(core::Code::kCancelled, "stopped while reading a blob");
    }
    if (!is_away(status)) {
      v1::throw_unless_ok(status, "read blob " + digest.hex());
    }
    back_off.wait(should_stop);
  }
  if (core::digest_of(data) != digest) {
    throw core::Error(core::Code::kDataLoss,
                      "blob " + digest.hex() + " did not arrive as it was stored");
  }
  return data;
}

void BlobClient::write(const core::Digest& digest, std::string_view data,
                       const std::function<bool()>& should_stop) {
  BackOff back_off;
  while (true) {
    grpc::ClientContext context;
    set_deadline(context, data.size());
    v1::WriteResponse response;
    const auto writer = stub_->Write(&context, &response);
    v1::WriteRequest request;
    request.set_digest(digest.binary());
    request.set_size_bytes(data.size());
    std::size_t sent = 0;
    do {
      const std::size_t size = std::min(v1::kChunkLimitBytes, data.size() - sent);
      request.set_data(std::string(data.substr(sent, size)));
      sent += size;
      if (!writer->Write(request)) {
        break;  // the answer is there already, good or bad
      }
      request.Clear();
    } while (sent < data.size());
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    if (status.ok()) {
      return;
    }
    if (should_stop()) {
      throw core::Error(core::Code::kCancelled, "stopped while writing a blob");
    }
    if (!is_away(status)) {
      v1::throw_unless_ok(status, "write blob " + digest.hex());
    }
    back_off.wait(should_stop);
  }
}

}  // namespace weft::worker
