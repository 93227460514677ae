#pragma once

#include <memory>
#include <string>

#include <grpcpp/channel.h>

namespace weft::client {

// A channel to one of weft's services, with the message limit of proto/limits.h and no proxy. With
// `keepalive_ms` above 0 the connection is probed so often while a call runs. Throws
// core::Error(kInvalidArgument) when the address is none.
[[nodiscard]] std::shared_ptr<grpc::Channel> open_channel(const std::string& address,
                                                          int keepalive_ms = 0);

}  // namespace weft::client
