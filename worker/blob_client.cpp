#include "worker/blob_client.h"

#include <algorithm>
#include <chrono>
#include <optional>

#include "core/error.h"
#include "proto/limits.h"
#include "proto/status.h"
#include "worker/back_off.h"

namespace weft::worker {

namespace {

constexpr std::chrono::seconds kAllowance{30};
constexpr std::uint64_t kSlowestBytesPerSecond = 1'000'000;

bool is_away(const grpc::Status& status) {
  // A coordinator that stops cancels the calls that it is answering.
  return status.error_code() == grpc::StatusCode::UNAVAILABLE ||
         status.error_code() == grpc::StatusCode::CANCELLED ||
         status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
}

}  // namespace

// One call, with a deadline for a slow line, that close() breaks off.
class BlobClient::Call {
 public:
  Call(BlobClient& client, std::uint64_t size_bytes) : client_(client) {
    const auto allowance = kAllowance + std::chrono::seconds(size_bytes / kSlowestBytesPerSecond);
    context_.set_deadline(gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC),
                                       gpr_time_from_seconds(allowance.count(), GPR_TIMESPAN)));
    const std::lock_guard lock(client_.mutex_);
    client_.running_.insert(&context_);
    if (client_.is_closed_) {
      context_.TryCancel();
    }
  }
  ~Call() {
    const std::lock_guard lock(client_.mutex_);
    client_.running_.erase(&context_);
  }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;
  Call(Call&&) = delete;
  Call& operator=(Call&&) = delete;
  [[nodiscard]] grpc::ClientContext& context() { return context_; }

 private:
  BlobClient& client_;
  grpc::ClientContext context_;
};

void BlobClient::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  for (grpc::ClientContext* const context : running_) {
    context->TryCancel();
  }
}

bool BlobClient::is_closed() {
  const std::lock_guard lock(mutex_);
  return is_closed_;
}

BlobClient::BlobClient(const std::shared_ptr<grpc::Channel>& channel)
    : stub_(v1::BlobService::NewStub(channel)) {}

std::string BlobClient::read(const core::Digest& digest, const std::function<bool()>& should_stop) {
  std::string data;
  BackOff back_off;
  while (true) {
    v1::ReadRequest request;
    request.set_digest(digest.binary());
    request.set_offset(data.size());
    Call call(*this, v1::kBlobLimitBytes);
    const auto reader = stub_->Read(&call.context(), request);
    v1::ReadResponse response;
    while (reader->Read(&response)) {
      data += response.data();
      back_off.reset();
      if (data.size() > v1::kBlobLimitBytes || should_stop()) {
        call.context().TryCancel();
      }
    }
    const grpc::Status status = reader->Finish();
    if (status.ok()) {
      break;
    }
    if (data.size() > v1::kBlobLimitBytes) {
      throw core::Error(core::Code::kDataLoss,
                        "blob " + digest.hex() + " is longer than any blob may be");
    }
    if (should_stop() || is_closed()) {
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

// How much of the blob the coordinator has kept of a broken upload; nothing when it has all.
std::optional<std::uint64_t> BlobClient::committed(const core::Digest& digest) {
  Call call(*this, 0);
  v1::QueryWriteRequest request;
  request.set_digest(digest.binary());
  v1::QueryWriteResponse response;
  const grpc::Status status = stub_->QueryWrite(&call.context(), request, &response);
  if (!status.ok()) {
    return 0;  // the upload itself will tell what is wrong
  }
  return response.complete() ? std::nullopt : std::optional(response.committed_bytes());
}

grpc::Status BlobClient::send(const core::Digest& digest, std::string_view data,
                              std::uint64_t offset) {
  Call call(*this, data.size());
  v1::WriteResponse response;
  const auto writer = stub_->Write(&call.context(), &response);
  v1::WriteRequest request;
  request.set_digest(digest.binary());
  request.set_size_bytes(data.size());
  request.set_offset(offset);
  std::size_t sent = offset;
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
  return writer->Finish();
}

void BlobClient::write(const std::vector<Blob>& blobs, const std::function<bool()>& should_stop) {
  if (blobs.size() == 1 && blobs.front().data.size() > v1::kChunkLimitBytes) {
    write_in_chunks(blobs.front(), should_stop);
  } else {
    write_together(blobs, should_stop);
  }
}

void BlobClient::throw_if_stopped(const std::function<bool()>& should_stop) {
  if (should_stop() || is_closed()) {
    throw core::Error(core::Code::kCancelled, "stopped while writing a blob");
  }
}

void BlobClient::write_together(const std::vector<Blob>& blobs,
                                const std::function<bool()>& should_stop) {
  v1::WriteManyRequest request;
  for (const Blob& blob : blobs) {
    v1::WholeBlob& whole = *request.add_blobs();
    whole.set_digest(blob.digest.binary());
    whole.set_data(blob.data);
  }
  BackOff back_off;
  while (true) {
    Call call(*this, request.ByteSizeLong());
    v1::WriteManyResponse response;
    const grpc::Status status = stub_->WriteMany(&call.context(), request, &response);
    if (status.ok()) {
      return;
    }
    throw_if_stopped(should_stop);
    if (!is_away(status)) {
      v1::throw_unless_ok(status, "write " + std::to_string(blobs.size()) + " blobs");
    }
    back_off.wait(should_stop);
  }
}

void BlobClient::write_in_chunks(const Blob& blob, const std::function<bool()>& should_stop) {
  const auto& [digest, data] = blob;
  BackOff back_off;
  std::uint64_t offset = 0;
  while (true) {
    const grpc::Status status = send(digest, data, offset);
    if (status.ok()) {
      return;
    }
    throw_if_stopped(should_stop);
    // Somebody else uploads it, the coordinator has kept less of it than it said, or what it kept
    // was damaged, and is dropped.
    const bool is_elsewhere = status.error_code() == grpc::StatusCode::ABORTED ||
                              status.error_code() == grpc::StatusCode::OUT_OF_RANGE;
    const bool was_damaged = status.error_code() == grpc::StatusCode::DATA_LOSS && offset > 0;
    if (!is_away(status) && !is_elsewhere && !was_damaged) {
      v1::throw_unless_ok(status, "write blob " + digest.hex());
    }
    back_off.wait(should_stop);
    const std::optional<std::uint64_t> kept = committed(digest);
    if (!kept) {
      return;
    }
    offset = *kept <= data.size() && !was_damaged ? *kept : 0;
  }
}

}  // namespace weft::worker
