#include "client/coordinator.h"

#include <random>

#include <fmt/format.h>

#include "core/error.h"
#include "proto/status.h"
#include "security/channel.h"
#include "security/tls_probe.h"

namespace weft::client {

Coordinator::Coordinator(security::Endpoint endpoint)
    : endpoint_(std::move(endpoint)), channel_(security::open_channel(endpoint_)) {
  jobs_ = v1::JobService::NewStub(channel_);
  workers_ = v1::WorkersService::NewStub(channel_);
  catalogue_ = v1::CatalogueService::NewStub(channel_);
}

bool Coordinator::is_worth_repeating(const grpc::Status& status) {
  // A server that stops cancels the calls that it is answering.
  return status.error_code() == grpc::StatusCode::UNAVAILABLE ||
         status.error_code() == grpc::StatusCode::CANCELLED ||
         status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
}

void Coordinator::check(const grpc::Status& status, const std::string& doing) const {
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    if (const std::string problem = security::tls_problem(endpoint_); !problem.empty()) {
      throw core::Error(core::Code::kPermissionDenied,
                        fmt::format("cannot {}: {}", doing, problem));
    }
  }
  if (is_worth_repeating(status)) {
    throw core::Error(
        core::Code::kUnavailable,
        fmt::format("cannot {}: no coordinator answers at {} ({}); start one with 'weft up', or "
                    "name another with --coordinator or WEFT_COORDINATOR",
                    doing, endpoint_.address, status.error_message()));
  }
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED ||
      status.error_code() == grpc::StatusCode::UNKNOWN) {
    throw core::Error(core::Code::kUnavailable,
                      fmt::format("cannot {}: what answers at {} is not a coordinator of this "
                                  "weft ({}); name another with --coordinator",
                                  doing, endpoint_.address, status.error_message()));
  }
  v1::throw_unless_ok(status, doing);
}

void Coordinator::set_deadline(grpc::ClientContext& context, std::chrono::seconds from_now) {
  const gpr_timespec after = gpr_time_from_seconds(from_now.count(), GPR_TIMESPAN);
  context.set_deadline(gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), after));
}

std::string new_request_id() {
  std::random_device device;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", device(), device(), device(), device());
}

}  // namespace weft::client
