#include "client/channel.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>

#include "core/error.h"
#include "proto/address.h"
#include "proto/limits.h"

namespace weft::client {

std::shared_ptr<grpc::Channel> open_channel(const std::string& address, int keepalive_ms) {
  const std::string mistake = v1::mistake_in_address(address);
  if (!mistake.empty()) {
    throw core::Error(core::Code::kInvalidArgument, mistake);
  }
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(v1::kMessageLimitBytes);
  arguments.SetMaxSendMessageSize(v1::kMessageLimitBytes);
  // A proxy between a person and a service on the same machine is never meant.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  if (keepalive_ms > 0) {
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, keepalive_ms);
  }
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

}  // namespace weft::client
