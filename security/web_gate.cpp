#include "security/web_gate.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include <arpa/inet.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "core/clock.h"
#include "core/error.h"
#include "proto/address.h"

namespace weft::security {

namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::string machine_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? lower(name.data()) : std::string();
}

// "hub.example:7413" is hub.example, "[::1]:7413" is ::1.
std::string without_port(const std::string& host) {
  if (host.starts_with('[')) {
    const std::size_t end = host.find(']');
    return end == std::string::npos ? host : host.substr(1, end - 1);
  }
  return host.substr(0, host.find(':'));
}

bool is_number(const std::string& host) {
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  return inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

// Called for each connection, before the server's certificate is sent: 0 ends the handshake.
int use_folder(SSL* connection, void* argument) {
  const TlsFolder& folder = *static_cast<const TlsFolder*>(argument);
  X509_STORE* const trusted = X509_STORE_new();
  const bool is_done =
      trusted != nullptr &&
      X509_STORE_load_locations(trusted, folder.authority().c_str(), nullptr) == 1 &&
      SSL_set1_verify_cert_store(connection, trusted) == 1 &&
      SSL_use_certificate_file(connection, folder.certificate().c_str(), SSL_FILETYPE_PEM) == 1 &&
      SSL_use_PrivateKey_file(connection, folder.key().c_str(), SSL_FILETYPE_PEM) == 1;
  X509_STORE_free(trusted);
  if (!is_done) {
    ERR_clear_error();
    spdlog::error("event=tls_folder_unreadable folder={}", folder.path.string());
    return 0;
  }
  // Tells browsers which of their certificates to offer; the connection owns the list.
  SSL_set_client_CA_list(connection, SSL_load_client_CA_file(folder.authority().c_str()));
  return 1;
}

}  // namespace

WebGate::WebGate(const Endpoint& listen, std::vector<std::string> hosts)
    : folder_{listen.tls_folder}, hosts_(std::move(hosts)) {
  const bool any_port = listen.address.ends_with(":0");
  const std::string mistake = v1::mistake_in_address(
      any_port ? listen.address.substr(0, listen.address.size() - 1) + "1" : listen.address);
  if (!mistake.empty() || listen.address.starts_with("unix:")) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the page cannot be at '" + listen.address +
                          "'; write HOST:PORT, like 127.0.0.1:7413, or off");
  }
  std::transform(hosts_.begin(), hosts_.end(), hosts_.begin(), lower);
  hosts_.push_back("localhost");
  hosts_.push_back(machine_name());
  if (!listen.tls_folder.empty()) {
    const Certificate own = check_tls_folder(folder_, TlsUse::kListen, core::system_clock().now());
    std::transform(own.hosts.begin(), own.hosts.end(), std::back_inserter(hosts_), lower);
    admission_ = std::make_unique<Admission>(folder_);
  } else if (!listen.insecure && !v1::is_local_address(listen.address)) {
    throw core::Error(core::Code::kPermissionDenied,
                      "the page at " + listen.address +
                          " can be reached from other machines, and without TLS whoever reaches it "
                          "may see everything; name the folder that 'weft certs issue' wrote with "
                          "--tls-folder, use a loopback address, or say --insecure in a network "
                          "that you trust");
  }
}

void WebGate::prepare(ssl_ctx_st& context) {
  SSL_CTX_set_min_proto_version(&context, TLS1_2_VERSION);
  SSL_CTX_set_verify(&context, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
  // A resumed session would skip the certificate, which may have been revoked meanwhile.
  SSL_CTX_set_session_cache_mode(&context, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_options(&context, SSL_OP_NO_TICKET);
  SSL_CTX_set_num_tickets(&context, 0);
  SSL_CTX_set_cert_cb(&context, use_folder, &folder_);
}

std::string WebGate::certificate_of(const ssl_st& connection) {
  X509* const certificate = SSL_get1_peer_certificate(&connection);
  if (certificate == nullptr) {
    return "";
  }
  BIO* const text = BIO_new(BIO_s_mem());
  std::string pem;
  if (text != nullptr && PEM_write_bio_X509(text, certificate) == 1) {
    char* data = nullptr;
    const long size = BIO_get_mem_data(text, &data);
    pem.assign(data, static_cast<std::size_t>(size));
  }
  BIO_free_all(text);
  X509_free(certificate);
  return pem;
}

Caller WebGate::caller_of(const std::string& certificate) {
  if (!speaks_tls()) {
    return {"", {v1::ROLE_ADMIN}};
  }
  admission_->refresh();
  const Admission::Verdict verdict = admission_->judge(certificate);
  if (!verdict.problem.empty()) {
    throw core::Error(core::Code::kPermissionDenied, verdict.problem);
  }
  return {verdict.certificate->name, verdict.certificate->roles};
}

bool WebGate::is_own_host(const std::string& host) const {
  const std::string name = lower(without_port(host));
  return is_number(name) ||
         (!name.empty() && std::find(hosts_.begin(), hosts_.end(), name) != hosts_.end());
}

}  // namespace weft::security
