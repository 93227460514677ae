#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "security/endpoint.h"
#include "security/web_gate.h"

namespace weft::coordinator {

// What a browser asks for, as far as we look at it.
struct HttpRequest {
  std::string method;
  std::string path;                          // decoded, without the query
  std::map<std::string, std::string> query;  // the first of each name
  std::string host;
  std::string fetch_site;   // Sec-Fetch-Site: where the page is from that asks; empty: unknown
  std::string known_etags;  // If-None-Match
  std::string certificate;  // of the caller, PEM; empty without TLS
};

struct HttpAnswer {
  // Sends bytes; false when the caller is gone, or took nothing for some seconds.
  using Write = std::function<bool(std::string_view bytes)>;

  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
  // In place of a body: called again and again, in the thread of the request, until it returns
  // false or the caller is gone.
  std::function<bool(const Write& write)> stream;
};

// Threads that answer, and so requests that are answered at the same time, streams included. Those
// that come meanwhile wait; a few are accepted, further ones wait in the kernel.
inline constexpr std::size_t kHttpThreads = 32;

// HTTP/1.1 on one address, one request a connection. Wraps cpp-httplib.
class HttpServer {
 public:
  // Called by several threads at once; must not throw.
  using Handler = std::function<HttpAnswer(const HttpRequest& request)>;

  // Listens from now on. `gate` is made for `listen`; it must outlive the server. Throws
  // core::Error(kUnavailable) when the address cannot be had.
  HttpServer(const security::Endpoint& listen, security::WebGate& gate, Handler handler);
  // Ends as stop() does.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;
  HttpServer(HttpServer&&) = delete;
  HttpServer& operator=(HttpServer&&) = delete;

  // HOST:PORT, with the port that is in use.
  [[nodiscard]] const std::string& address() const { return address_; }

  // Takes no more requests, and returns when those under way are answered: the caller sees to it
  // that streams end.
  void stop();

 private:
  struct Insides;
  std::unique_ptr<Insides> insides_;
  std::string address_;
};

}  // namespace weft::coordinator
