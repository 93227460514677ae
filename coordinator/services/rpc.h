#pragma once

#include <exception>
#include <type_traits>
#include <utility>

#include <grpcpp/server_context.h>
#include <grpcpp/support/status.h>
#include <spdlog/spdlog.h>

#include "core/error.h"
#include "proto/status.h"
#include "security/caller.h"

namespace weft::coordinator {

// The status of what a body threw: the one place where a service catches.
template <class Body>
grpc::Status status_of(const char* call, Body&& body) {
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

// Runs the body of an RPC ("JobService.Submit") if the caller has the role that the call's option
// names, and turns what it throws into the call's status. The body is called with the caller
// (security::Caller) if it takes one argument. A handler that answers later, by a reactor, asks
// security::check_role itself, inside status_of.
template <class Body>
grpc::Status answer(const grpc::ServerContextBase& context, const char* call, Body&& body) {
  return status_of(call, [&]() -> grpc::Status {
    const security::Caller caller = security::check_role(context, call);
    if constexpr (std::is_invocable_v<Body, const security::Caller&>) {
      return std::forward<Body>(body)(caller);
    } else {
      return std::forward<Body>(body)();
    }
  });
}

}  // namespace weft::coordinator
