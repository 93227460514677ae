#pragma once

#include <string>

#include "security/endpoint.h"

namespace weft::security {

// Why no connection to a service that should be at `endpoint` comes about, in a sentence for
// people; empty when TLS is not the reason, as far as can be told. gRPC says of every failed
// handshake that the peer is unavailable; this makes one handshake of its own and reads what each
// side objects to. Takes seconds at most. Throws nothing.
[[nodiscard]] std::string tls_problem(const Endpoint& endpoint);

}  // namespace weft::security
