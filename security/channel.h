#pragma once

#include <memory>

#include <grpcpp/channel.h>

#include "security/endpoint.h"

namespace weft::security {

// A channel to one of weft's services: with the message limit and the keepalive of proto/limits.h,
// without a proxy. With a TLS folder the service must show a certificate of the folder's authority
// for the host that is called, and new certificates in the folder are used from the next connection
// on. `longest_wait_ms`: between attempts to connect again; 0: gRPC's own, up to two minutes.
// Throws core::Error: kInvalidArgument when the address is none, kPermissionDenied when other
// machines reach it and neither a TLS folder nor `insecure` is there, and what check_tls_folder
// throws.
[[nodiscard]] std::shared_ptr<grpc::Channel> open_channel(const Endpoint& endpoint,
                                                          int longest_wait_ms = 0);

}  // namespace weft::security
