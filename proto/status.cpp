#include "proto/status.h"

namespace weft::v1 {

namespace {

grpc::StatusCode grpc_code(core::Code code) {
  switch (code) {
    case core::Code::kInvalidArgument:
      return grpc::StatusCode::INVALID_ARGUMENT;
    case core::Code::kNotFound:
      return grpc::StatusCode::NOT_FOUND;
    case core::Code::kAlreadyExists:
      return grpc::StatusCode::ALREADY_EXISTS;
    case core::Code::kFailedPrecondition:
      return grpc::StatusCode::FAILED_PRECONDITION;
    case core::Code::kPermissionDenied:
      return grpc::StatusCode::PERMISSION_DENIED;
    case core::Code::kResourceExhausted:
      return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case core::Code::kUnavailable:
      return grpc::StatusCode::UNAVAILABLE;
    case core::Code::kDataLoss:
      return grpc::StatusCode::DATA_LOSS;
    case core::Code::kCancelled:
      return grpc::StatusCode::CANCELLED;
    case core::Code::kInternal:
      return grpc::StatusCode::INTERNAL;
  }
  return grpc::StatusCode::INTERNAL;
}

core::Code core_code(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::OUT_OF_RANGE:
      return core::Code::kInvalidArgument;
    case grpc::StatusCode::NOT_FOUND:
      return core::Code::kNotFound;
    case grpc::StatusCode::ALREADY_EXISTS:
      return core::Code::kAlreadyExists;
    case grpc::StatusCode::FAILED_PRECONDITION:
    case grpc::StatusCode::ABORTED:
      return core::Code::kFailedPrecondition;
    case grpc::StatusCode::PERMISSION_DENIED:
    case grpc::StatusCode::UNAUTHENTICATED:
      return core::Code::kPermissionDenied;
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return core::Code::kResourceExhausted;
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return core::Code::kUnavailable;
    case grpc::StatusCode::DATA_LOSS:
      return core::Code::kDataLoss;
    case grpc::StatusCode::CANCELLED:
      return core::Code::kCancelled;
    default:
      return core::Code::kInternal;
  }
}

}  // namespace

grpc::Status to_status(const core::Error& error) { return {grpc_code(error.code()), error.what()}; }

void throw_unless_ok(const grpc::Status& status, const std::string& doing) {
  if (status.ok()) {
    return;
  }
  const core::Code code = core_code(status.error_code());
  if (code == core::Code::kUnavailable) {
    throw core::Error(code, doing + ": the coordinator does not answer (" + status.error_message() +
                                "); is it running, and is the address right?");
  }
  throw core::Error(code, status.error_message());
}

}  // namespace weft::v1
