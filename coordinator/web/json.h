#pragma once

#include <string>

#include <google/protobuf/message.h>

#include "core/error.h"

namespace weft::coordinator {

// The page's data are the responses of cluster.proto in protobuf's own JSON mapping, on one line:
// fields under their names there, left out where they are 0, false or empty; 64-bit numbers as
// texts; bytes in base64.
[[nodiscard]] std::string json_of(const google::protobuf::Message& message);
// {"error":{"code":"not_found","message":"..."}}
[[nodiscard]] std::string json_of(const core::Error& error);
[[nodiscard]] int http_status_of(core::Code code);

}  // namespace weft::coordinator
