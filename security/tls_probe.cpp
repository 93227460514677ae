#include "security/tls_probe.h"

#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/clock.h"
#include "core/error.h"
#include "core/file.h"
#include "proto/address.h"
#include "security/tls_folder.h"
#include "security/x509.h"

namespace weft::security {

namespace {

constexpr int kTimeoutMs = 2000;

class Socket {
 public:
  explicit Socket(int file) : file_(file) {}
  ~Socket() {
    if (file_ >= 0) {
      close(file_);
    }
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  Socket(Socket&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  Socket& operator=(Socket&&) = delete;

  [[nodiscard]] int file() const { return file_; }
  // Within the timeout; reads and writes then have it too.
  [[nodiscard]] bool connect_to(const sockaddr* address, socklen_t size) const {
    if (file_ < 0 || fcntl(file_, F_SETFL, O_NONBLOCK) != 0) {
      return false;
    }
    if (connect(file_, address, size) != 0) {
      pollfd waiting{file_, POLLOUT, 0};
      int failure = 0;
      socklen_t length = sizeof(failure);
      if (errno != EINPROGRESS || poll(&waiting, 1, kTimeoutMs) != 1 ||
          getsockopt(file_, SOL_SOCKET, SO_ERROR, &failure, &length) != 0 || failure != 0) {
        return false;
      }
    }
    const timeval limit{kTimeoutMs / 1000, 0};
    return fcntl(file_, F_SETFL, 0) == 0 &&
           setsockopt(file_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit)) == 0 &&
           setsockopt(file_, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof(limit)) == 0;
  }

 private:
  int file_;
};

// The host of an address, without the brackets of IPv6.
std::string host_of(const std::string& address) {
  if (address.starts_with("unix:")) {
    return "localhost";  // what gRPC takes a Unix socket's host to be
  }
  std::string host = address.substr(0, address.rfind(':'));
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  return host;
}

std::optional<Socket> connect_to(const std::string& address) {
  if (address.starts_with("unix:")) {
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    const std::string path = address.substr(std::strlen("unix:"));
    if (path.size() >= sizeof(to.sun_path)) {
      return std::nullopt;
    }
    path.copy(to.sun_path, path.size());
    Socket socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    return socket.connect_to(reinterpret_cast<const sockaddr*>(&to), sizeof(to))
               ? std::optional(std::move(socket))
               : std::nullopt;
  }
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const std::string port = address.substr(address.rfind(':') + 1);
  if (getaddrinfo(host_of(address).c_str(), port.c_str(), &hints, &found) != 0) {
    return std::nullopt;
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owned(found, freeaddrinfo);
  for (const addrinfo* each = found; each != nullptr; each = each->ai_next) {
    Socket socket(::socket(each->ai_family, each->ai_socktype | SOCK_CLOEXEC, each->ai_protocol));
    if (socket.connect_to(each->ai_addr, each->ai_addrlen)) {
      return socket;
    }
  }
  return std::nullopt;
}

using Context = std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)>;
using Connection = std::unique_ptr<SSL, decltype(&SSL_free)>;

// A connection that will show the folder's certificate; without a folder, none.
Connection make_connection(SSL_CTX& context, const Endpoint& endpoint, int file) {
  static constexpr unsigned char kProtocols[] = {2, 'h', '2'};
  Connection connection(SSL_new(&context), &SSL_free);
  const std::string host = host_of(endpoint.address);
  if (connection == nullptr || SSL_set_fd(connection.get(), file) != 1 ||
      SSL_set_alpn_protos(connection.get(), kProtocols, sizeof(kProtocols)) != 0) {
    return {nullptr, &SSL_free};
  }
  if (endpoint.tls_folder.empty()) {
    return connection;
  }
  const TlsFolder folder{endpoint.tls_folder};
  X509_VERIFY_PARAM* parameters = SSL_get0_param(connection.get());
  const bool names_host = X509_VERIFY_PARAM_set1_ip_asc(parameters, host.c_str()) == 1 ||
                          X509_VERIFY_PARAM_set1_host(parameters, host.c_str(), 0) == 1;
  if (!names_host ||
      SSL_use_certificate_file(connection.get(), folder.certificate().c_str(), SSL_FILETYPE_PEM) !=
          1 ||
      SSL_use_PrivateKey_file(connection.get(), folder.key().c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_load_verify_locations(&context, folder.authority().c_str(), nullptr) != 1) {
    return {nullptr, &SSL_free};
  }
  // The handshake goes on whatever is found; OpenSSL drops a certificate that it refuses.
  SSL_set_verify(connection.get(), SSL_VERIFY_NONE, nullptr);
  return connection;
}

std::string peer_pem(const SSL& connection) {
  const std::unique_ptr<X509, decltype(&X509_free)> peer(SSL_get1_peer_certificate(&connection),
                                                         &X509_free);
  const std::unique_ptr<BIO, decltype(&BIO_free_all)> bio(BIO_new(BIO_s_mem()), &BIO_free_all);
  if (!peer || !bio || PEM_write_bio_X509(bio.get(), peer.get()) != 1) {
    return "";
  }
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

// What is wrong with the certificate that the server showed.
std::string objection_to_server(const std::string& pem, long reason, const Endpoint& endpoint) {
  const std::string where = fmt::format("what answers at {}", endpoint.address);
  const Certificate server = read_certificate(pem);
  const Certificate authority =
      read_certificate(core::read_file(TlsFolder{endpoint.tls_folder}.authority()));
  switch (reason) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
      return fmt::format(
          "{} has a certificate ('{}') that expired on {}; whoever keeps the "
          "authority issues it anew with 'weft certs issue {}'",
          where, server.name, date_text(server.valid_until), server.name);
    case X509_V_ERR_CERT_NOT_YET_VALID:
      return fmt::format(
          "{} has a certificate ('{}') that is valid from {} on only; is this "
          "machine's clock right?",
          where, server.name, date_text(server.valid_from));
    case X509_V_ERR_HOSTNAME_MISMATCH:
    case X509_V_ERR_IP_ADDRESS_MISMATCH:
      return fmt::format(
          "{} has a certificate ('{}') for {}, and not for this host; call it by one "
          "of these names, or issue it anew with --host {}",
          where, server.name, fmt::join(server.hosts, ", "), host_of(endpoint.address));
    case X509_V_ERR_INVALID_PURPOSE:
      return fmt::format(
          "{} has a certificate ('{}') that is no server's; issue it anew with "
          "--host {}",
          where, server.name, host_of(endpoint.address));
    default:
      return fmt::format(
          "{} has a certificate ('{}') of another authority ('{}') than the one in {} "
          "('{}'); name the folder that was issued for that cluster",
          where, server.name, server.issuer, endpoint.tls_folder, authority.name);
  }
}

// What the server said of our certificate when it closed the connection.
std::string objection_of_server(const Endpoint& endpoint) {
  const Certificate mine =
      read_certificate(core::read_file(TlsFolder{endpoint.tls_folder}.certificate()));
  const std::string begin = fmt::format(
      "what answers at {} does not accept the certificate of '{}'", endpoint.address, mine.name);
  switch (ERR_GET_REASON(ERR_peek_error())) {
    case SSL_R_SSLV3_ALERT_CERTIFICATE_EXPIRED:
      return begin +
             ": it has expired by that machine's clock; issue it anew with 'weft certs issue'";
    case SSL_R_SSLV3_ALERT_CERTIFICATE_REVOKED:
      return begin + ": it was revoked";
    default:
      return fmt::format(
          "{}: it trusts another authority than '{}', or the certificate has expired "
          "by its clock (here it is good until {})",
          begin, mine.issuer, date_text(mine.valid_until));
  }
}

// With a folder: a handshake as gRPC makes it, then the first bytes of the server, which come when
// it has accepted our certificate.
std::string problem_with_folder(SSL& connection, const Endpoint& endpoint) {
  const bool is_connected = SSL_connect(&connection) == 1;
  const long reason = SSL_get_verify_result(&connection);
  const std::string pem = peer_pem(connection);
  if (!pem.empty() && reason != X509_V_OK) {
    return objection_to_server(pem, reason, endpoint);
  }
  if (!pem.empty()) {
    char first = 0;
    return is_connected && SSL_read(&connection, &first, 1) > 0 ? std::string()
                                                                : objection_of_server(endpoint);
  }
  return fmt::format(
      "what answers at {} does not speak TLS; was it started without --tls-folder? "
      "Then leave --tls-folder and WEFT_TLS_FOLDER away too",
      endpoint.address);
}

}  // namespace

std::string tls_problem(const Endpoint& endpoint) {
  try {
    if (!v1::mistake_in_address(endpoint.address).empty()) {
      return "";
    }
    if (!endpoint.tls_folder.empty()) {
      static_cast<void>(check_tls_folder(TlsFolder{endpoint.tls_folder}, TlsUse::kCall,
                                         core::system_clock().now()));
    }
    const std::optional<Socket> socket = connect_to(endpoint.address);
    const Context context(SSL_CTX_new(TLS_client_method()), &SSL_CTX_free);
    if (!socket || !context) {
      return "";
    }
    ERR_clear_error();
    const Connection connection = make_connection(*context, endpoint, socket->file());
    if (connection == nullptr) {
      return "";
    }
    if (!endpoint.tls_folder.empty()) {
      return problem_with_folder(*connection, endpoint);
    }
    // A server that asks for a certificate shows its own first.
    static_cast<void>(SSL_connect(connection.get()));
    return peer_pem(*connection).empty()
               ? std::string()
               : fmt::format(
                     "what answers at {} speaks TLS; name the folder that 'weft certs "
                     "issue' wrote for you with --tls-folder or WEFT_TLS_FOLDER",
                     endpoint.address);
  } catch (const core::Error& error) {
    return error.what();
  }
}

}  // namespace weft::security
