#include "security/grpc_setup.h"

#include <cstdlib>

#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

namespace weft::security {

namespace {

// How often gRPC looks at a connection that is being made while no call waits for it. Its own 5 s
// come twice, for the connection and for the greeting on it, which is longer than a short lease,
// and than a person likes to wait for a coordinator that is back.
constexpr const char* kConnectionLook = "GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS";
constexpr const char* kConnectionLookMs = "200";

void log_error(gpr_log_func_args* said) {
  if (said->severity == GPR_LOG_SEVERITY_ERROR) {
    spdlog::warn("event=grpc message=\"{}\"", said->message);
  }
}

void ignore(gpr_log_func_args* /*said*/) {}

}  // namespace

void set_up_grpc(GrpcSays says) {
  ::setenv(kConnectionLook, kConnectionLookMs, 0);  // NOLINT(concurrency-mt-unsafe)
  gpr_set_log_function(says == GrpcSays::kToLog ? log_error : ignore);
}

}  // namespace weft::security
