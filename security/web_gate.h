#pragma once

#include <memory>
#include <string>
#include <vector>

#include "security/admission.h"
#include "security/caller.h"
#include "security/endpoint.h"

struct ssl_ctx_st;  // OpenSSL's SSL_CTX
struct ssl_st;      // and SSL

namespace weft::security {

// Stands between an HTTP server and those who call it, as ServerGate does for gRPC: on an address
// that other machines reach it wants TLS with certificates of the folder's authority, on both
// sides. Any thread.
class WebGate {
 public:
  // `listen` is HOST:PORT; `hosts`: further names by which browsers may call. Throws core::Error:
  // kInvalidArgument when it is no such address, kPermissionDenied when other machines reach it and
  // neither a TLS folder nor `insecure` is there, and what check_tls_folder throws.
  WebGate(const Endpoint& listen, std::vector<std::string> hosts);

  [[nodiscard]] bool speaks_tls() const { return admission_ != nullptr; }

  // Makes the server's context ask every caller for a certificate that the folder's authority
  // signed. What the folder holds is read for each connection, so that new certificates are used
  // without a restart. The gate must outlive the context. REQUIRES: speaks_tls().
  void prepare(ssl_ctx_st& context);
  // The certificate that the other side showed, as PEM; empty when it showed none.
  [[nodiscard]] static std::string certificate_of(const ssl_st& connection);

  // Who shows this certificate; without TLS everyone is a local admin. Throws
  // core::Error(kPermissionDenied) when it was revoked, has expired or cannot be read.
  [[nodiscard]] Caller caller_of(const std::string& certificate);

  // Whether a browser that calls by this Host header calls us: by a number, localhost, a name of
  // this machine, of its certificate or of `hosts`. Any other name may be a stranger's page that
  // lets its own name point here (DNS rebinding).
  [[nodiscard]] bool is_own_host(const std::string& host) const;

 private:
  TlsFolder folder_;
  std::vector<std::string> hosts_;        // in lower case
  std::unique_ptr<Admission> admission_;  // empty without TLS
};

}  // namespace weft::security
