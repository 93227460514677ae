#pragma once

#include <exception>
#include <utility>

#include <grpcpp/server_context.h>
#include <grpcpp/support/status.h>
#include <spdlog/spdlog.h>

#include "core/error.h"
#include "proto/status.h"

namespace weft::coordinator {

// Runs the body of an RPC ("JobService.Submit") and turns what it throws into the call's status:
// the one place where a service catches.
template <class Body>
grpc::Status answer(const grpc::ServerContextBase& /*context*/, const char* call, Body&& body) {
  try {
    return std::forward<Body>(body)();
  } catch (const core::Error& error) {
    spdlog::debug("call={} event=refused message=\"{}\"", call, error.what());
    return v1::to_status(error);
  } catch (const std::exception& error) {
    spdlog::error("call={} event=internal_error message=\"{}\"", call, error.what());
    return {grpc::StatusCode::INTERNAL, error.what()};
  }
}

}  // namespace weft::coordinator
