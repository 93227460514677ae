#include "security/server_gate.h"

#include <chrono>
#include <condition_variable>
#include <list>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <grpc/grpc_security_constants.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/security/auth_metadata_processor.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/server_interceptor.h>
#include <spdlog/spdlog.h>

#include "core/clock.h"
#include "core/error.h"
#include "proto/address.h"
#include "proto/limits.h"
#include "proto/status.h"
#include "security/admission.h"
#include "security/caller.h"
#include "security/roles.h"
#include "security/tls_folder.h"
#include "security/x509.h"

namespace weft::security {

namespace {

constexpr unsigned kRefreshSeconds = 2;
constexpr auto kBetweenLooks = std::chrono::seconds(1);
// Connections are begun anew after this time, so that a caller's new certificate is used before the
// old one expires. Calls under way stay on the old connection until they end.
constexpr int kConnectionAgeMs = 300'000;

// "/weft.v1.JobService/Submit" is JobService.Submit; empty when it is no call of weft.
std::string call_of(std::string_view path) {
  constexpr std::string_view kPrefix = "/weft.v1.";
  const std::size_t slash = path.rfind('/');
  if (!path.starts_with(kPrefix) || slash < kPrefix.size()) {
    return "";
  }
  return fmt::format("{}.{}", path.substr(kPrefix.size(), slash - kPrefix.size()),
                     path.substr(slash + 1));
}

// Health and reflection: any role may ask.
bool is_for_everyone(std::string_view path) {
  return path.starts_with("/grpc.health.v1.Health/") || path.starts_with("/grpc.reflection.");
}

// gRPC takes both services into the servers of builders that are made afterwards.
std::unique_ptr<grpc::ServerBuilder> new_builder() {
  static const bool is_done = [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    return true;
  }();
  static_cast<void>(is_done);
  return std::make_unique<grpc::ServerBuilder>();
}

std::string pem_of(const grpc::AuthContext& peer) {
  const auto pem = peer.FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
  return pem.empty() ? std::string() : std::string(pem.front().data(), pem.front().size());
}

}  // namespace

// Knows who may call now. Any thread.
class ServerGate::Guard {
 public:
  explicit Guard(TlsFolder folder) : admission_(std::move(folder)) {
    thread_ = std::thread([this] { look_now_and_then(); });
  }
  ~Guard() {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
    }
    wake_.notify_all();
    thread_.join();
  }
  Guard(const Guard&) = delete;
  Guard& operator=(const Guard&) = delete;
  Guard(Guard&&) = delete;
  Guard& operator=(Guard&&) = delete;

  [[nodiscard]] grpc::Status admit(const std::string& pem, std::string_view path) {
    const Admission::Verdict verdict = admission_.judge(pem);
    if (!verdict.problem.empty()) {
      return {grpc::StatusCode::UNAUTHENTICATED, verdict.problem};
    }
    const Caller caller{verdict.certificate->name, verdict.certificate->roles};
    if (is_for_everyone(path)) {
      return caller.roles.empty()
                 ? grpc::Status(grpc::StatusCode::PERMISSION_DENIED,
                                "the certificate of '" + caller.user + "' gives no role")
                 : grpc::Status::OK;
    }
    try {
      check_role(caller, call_of(path));
      return grpc::Status::OK;
    } catch (const core::Error& error) {
      return error.code() == core::Code::kInternal
                 ? grpc::Status(grpc::StatusCode::UNIMPLEMENTED, "no such call")
                 : v1::to_status(error);
    }
  }

  using Calls = std::list<std::pair<grpc::ServerContextBase*, const Certificate>>;
  // The call is cancelled when its certificate is no longer good, until it is forgotten.
  [[nodiscard]] std::optional<Calls::iterator> remember(grpc::ServerContextBase& context) {
    const Admission::Verdict verdict = admission_.judge(pem_of(*context.auth_context()));
    if (!verdict.certificate) {
      return std::nullopt;
    }
    const std::lock_guard lock(mutex_);
    return calls_.insert(calls_.end(), {&context, *verdict.certificate});
  }
  void forget(Calls::iterator call) {
    const std::lock_guard lock(mutex_);
    calls_.erase(call);
  }

 private:
  void look_now_and_then() {
    std::unique_lock lock(mutex_);
    while (!wake_.wait_for(lock, kBetweenLooks, [this] { return ending_; })) {
      admission_.refresh();
      for (const auto& [context, certificate] : calls_) {
        if (!admission_.problem_of(certificate).empty()) {
          context->TryCancel();
        }
      }
    }
  }

  Admission admission_;
  std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  bool ending_ = false;
  Calls calls_;
  std::thread thread_;
};

// Asked by gRPC before a call of any service begins.
class ServerGate::Processor final : public grpc::AuthMetadataProcessor {
 public:
  explicit Processor(std::shared_ptr<Guard> guard) : guard_(std::move(guard)) {}
  [[nodiscard]] bool IsBlocking() const override { return false; }
  grpc::Status Process(const InputMetadata& metadata, grpc::AuthContext* peer,
                       OutputMetadata* /*consumed*/, OutputMetadata* /*response*/) override {
    const auto path = metadata.find(":path");
    if (path == metadata.end()) {
      return {grpc::StatusCode::INTERNAL, "the call has no path"};
    }
    return guard_->admit(pem_of(*peer), {path->second.data(), path->second.size()});
  }

 private:
  std::shared_ptr<Guard> guard_;
};

// One for each call that was admitted: lets the guard reach it until its status is on the way.
class ServerGate::Watch final : public grpc::experimental::Interceptor {
 public:
  Watch(std::shared_ptr<Guard> guard, grpc::ServerContextBase& context)
      : guard_(std::move(guard)), context_(context) {}
  ~Watch() override { forget(); }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;
  Watch(Watch&&) = delete;
  Watch& operator=(Watch&&) = delete;

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    using Point = grpc::experimental::InterceptionHookPoints;
    // Before this the context has no call yet, after the status it may go at any time.
    if (methods->QueryInterceptionHookPoint(Point::POST_RECV_INITIAL_METADATA)) {
      call_ = guard_->remember(context_);
    } else if (methods->QueryInterceptionHookPoint(Point::PRE_SEND_STATUS)) {
      forget();
    }
    methods->Proceed();
  }

  class Factory final : public grpc::experimental::ServerInterceptorFactoryInterface {
   public:
    explicit Factory(std::shared_ptr<Guard> guard) : guard_(std::move(guard)) {}
    grpc::experimental::Interceptor* CreateServerInterceptor(
        grpc::experimental::ServerRpcInfo* info) override {
      return std::make_unique<Watch>(guard_, *info->server_context()).release();
    }

   private:
    std::shared_ptr<Guard> guard_;
  };

 private:
  void forget() {
    if (call_) {
      guard_->forget(*call_);
      call_.reset();
    }
  }

  std::shared_ptr<Guard> guard_;
  grpc::ServerContextBase& context_;
  std::optional<Guard::Calls::iterator> call_;
};

ServerGate::ServerGate(const Endpoint& listen) : builder_(new_builder()), listen_(listen.address) {
  builder_->SetMaxReceiveMessageSize(v1::kMessageLimitBytes);
  builder_->SetMaxSendMessageSize(v1::kMessageLimitBytes);
  // Two servers must not share a port.
  builder_->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder_->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, v1::kKeepaliveMs);
  builder_->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, v1::kKeepaliveTimeoutMs);
  builder_->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder_->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                               v1::kFastestPingMs);
  builder_->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, v1::kStreamsPerConnectionLimit);
  if (!listen.tls_folder.empty()) {
    secure(listen.tls_folder);
  } else if (listen.insecure || v1::is_local_address(listen_)) {
    builder_->AddListeningPort(listen_, grpc::InsecureServerCredentials(), &port_);
  } else {
    throw core::Error(core::Code::kPermissionDenied,
                      listen_ +
                          " can be reached from other machines, and without TLS calls are neither "
                          "encrypted nor checked; name the folder that 'weft certs issue' wrote "
                          "with --tls-folder, listen on 127.0.0.1:PORT or unix:PATH, or say "
                          "--insecure in a network that you trust");
  }
}

void ServerGate::secure(const std::string& path) {
  const TlsFolder folder{path};
  const Certificate certificate =
      check_tls_folder(folder, TlsUse::kListen, core::system_clock().now());
  guard_ = std::make_shared<Guard>(folder);
  grpc::experimental::TlsServerCredentialsOptions options(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          folder.key(), folder.certificate(), folder.authority(), kRefreshSeconds));
  options.watch_root_certs();
  options.watch_identity_key_cert_pairs();
  options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  const auto credentials = grpc::experimental::TlsServerCredentials(options);
  credentials->SetAuthMetadataProcessor(std::make_shared<Processor>(guard_));
  builder_->AddListeningPort(listen_, credentials, &port_);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> factories;
  factories.push_back(std::make_unique<Watch::Factory>(guard_));
  builder_->experimental().SetInterceptorCreators(std::move(factories));
  builder_->AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_MS, kConnectionAgeMs);
  spdlog::info("event=tls name={} hosts={} until={}", certificate.name,
               fmt::join(certificate.hosts, ","), date_text(certificate.valid_until));
}

std::unique_ptr<grpc::Server> ServerGate::start() {
  std::unique_ptr<grpc::Server> server = builder_->BuildAndStart();
  if (server == nullptr || port_ == 0) {
    throw core::Error(core::Code::kUnavailable,
                      "cannot listen on " + listen_ +
                          "; is it written HOST:PORT or unix:PATH, and is another program using "
                          "it?");
  }
  return server;
}

ServerGate::~ServerGate() = default;

std::string ServerGate::address() const {
  return listen_.starts_with("unix:")
             ? listen_
             : listen_.substr(0, listen_.rfind(':') + 1) + std::to_string(port_);
}

}  // namespace weft::security
