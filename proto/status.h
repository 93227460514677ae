#pragma once

#include <string>

#include <grpcpp/support/status.h>

#include "core/error.h"

namespace weft::v1 {

// The status that tells `error` to the other end of a call, and back again: a server answers
// to_status(error), its client calls throw_unless_ok and has the same code and message.
[[nodiscard]] grpc::Status to_status(const core::Error& error);

// Throws core::Error for every status but OK; `doing` ("submit silk") starts the message where the
// call itself failed (UNAVAILABLE, DEADLINE_EXCEEDED).
void throw_unless_ok(const grpc::Status& status, const std::string& doing);

}  // namespace weft::v1
