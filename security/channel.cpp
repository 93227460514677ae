#include "security/channel.h"

#include <algorithm>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <grpcpp/support/channel_arguments.h>

#include "core/clock.h"
#include "core/error.h"
#include "proto/address.h"
#include "proto/limits.h"
#include "security/tls_folder.h"

namespace weft::security {

namespace {

constexpr int kFirstWaitMs = 200;
constexpr unsigned kRefreshSeconds = 2;

void check(const Endpoint& endpoint) {
  const std::string mistake = v1::mistake_in_address(endpoint.address);
  if (!mistake.empty()) {
    throw core::Error(core::Code::kInvalidArgument, mistake);
  }
  if (endpoint.tls_folder.empty() && !endpoint.insecure &&
      !v1::is_local_address(endpoint.address)) {
    throw core::Error(
        core::Code::kPermissionDenied,
        endpoint.address +
            " is on another machine, and without TLS everyone in between can read and "
            "change what is said; name the folder that 'weft certs issue' wrote with "
            "--tls-folder or WEFT_TLS_FOLDER, or say --insecure in a network that "
            "you trust");
  }
}

std::shared_ptr<grpc::ChannelCredentials> credentials(const Endpoint& endpoint) {
  if (endpoint.tls_folder.empty()) {
    return grpc::InsecureChannelCredentials();
  }
  const TlsFolder folder{endpoint.tls_folder};
  static_cast<void>(check_tls_folder(folder, TlsUse::kCall, core::system_clock().now()));
  grpc::experimental::TlsChannelCredentialsOptions options;
  options.set_certificate_provider(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          folder.key(), folder.certificate(), folder.authority(), kRefreshSeconds));
  options.watch_root_certs();
  options.watch_identity_key_cert_pairs();
  options.set_certificate_verifier(
      std::make_shared<grpc::experimental::HostNameCertificateVerifier>());
  return grpc::experimental::TlsCredentials(options);
}

}  // namespace

std::shared_ptr<grpc::Channel> open_channel(const Endpoint& endpoint, int longest_wait_ms) {
  check(endpoint);
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(v1::kMessageLimitBytes);
  arguments.SetMaxSendMessageSize(v1::kMessageLimitBytes);
  // A proxy between a person and a service on the same machine is never meant.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, v1::kKeepaliveMs);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, v1::kKeepaliveTimeoutMs);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);  // as many as it takes
  if (longest_wait_ms > 0) {
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, longest_wait_ms);
    arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS,
                     std::min(kFirstWaitMs, longest_wait_ms));
  }
  return grpc::CreateCustomChannel(endpoint.address, credentials(endpoint), arguments);
}

}  // namespace weft::security
