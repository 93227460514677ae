#include "coordinator/web/json.h"

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

namespace weft::coordinator {

namespace {

const char* name_of(core::Code code) {
  switch (code) {
    case core::Code::kInvalidArgument:
      return "invalid_argument";
    case core::Code::kNotFound:
      return "not_found";
    case core::Code::kAlreadyExists:
      return "already_exists";
    case core::Code::kFailedPrecondition:
      return "failed_precondition";
    case core::Code::kPermissionDenied:
      return "permission_denied";
    case core::Code::kResourceExhausted:
      return "resource_exhausted";
    case core::Code::kUnavailable:
      return "unavailable";
    case core::Code::kDataLoss:
      return "data_loss";
    case core::Code::kCancelled:
      return "cancelled";
    case core::Code::kInternal:
      return "internal";
  }
  return "internal";
}

}  // namespace

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string text;
  const auto status = google::protobuf::util::MessageToJsonString(message, &text, options);
  if (!status.ok()) {
    throw core::Error(core::Code::kInternal, "no JSON of this: " + status.ToString());
  }
  return text;
}

std::string json_of(const core::Error& error) {
  const nlohmann::json json = {
      {"error", {{"code", name_of(error.code())}, {"message", error.what()}}}};
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

int http_status_of(core::Code code) {
  switch (code) {
    case core::Code::kInvalidArgument:
      return 400;
    case core::Code::kPermissionDenied:
      return 403;
    case core::Code::kNotFound:
      return 404;
    case core::Code::kAlreadyExists:
    case core::Code::kFailedPrecondition:
      return 409;
    case core::Code::kResourceExhausted:
    case core::Code::kCancelled:
    case core::Code::kUnavailable:
      return 503;
    default:
      return 500;
  }
}

}  // namespace weft::coordinator
