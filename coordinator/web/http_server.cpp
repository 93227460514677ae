#include "coordinator/web/http_server.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <semaphore>
#include <string>
#include <thread>

#include <httplib.h>
#include <spdlog/spdlog.h>

#include "core/error.h"

namespace weft::coordinator {

namespace {

constexpr std::ptrdiff_t kAcceptedLimit = 64;  // connections, being answered and waiting
constexpr time_t kSilenceSeconds = 5;          // of a caller that does not read or write
constexpr time_t kIdleSeconds = 3;             // of a connection on which nothing is asked
constexpr std::size_t kBodyLimitBytes = 4096;  // no request needs one

// httplib's threads, behind a door: it accepts connections without a limit otherwise, and each is a
// file that the journal may need.
class BoundedQueue : public httplib::TaskQueue {
 public:
  explicit BoundedQueue(std::size_t threads) : threads_(threads) {}
  void enqueue(std::function<void()> work) override {
    places_.acquire();
    threads_.enqueue([this, work = std::move(work)] {
      work();
      places_.release();
    });
  }
  void shutdown() override { threads_.shutdown(); }

 private:
  std::counting_semaphore<kAcceptedLimit> places_{kAcceptedLimit};
  httplib::ThreadPool threads_;
};

HttpRequest request_of(const httplib::Request& from) {
  HttpRequest request;
  request.method = from.method;
  request.path = from.path;
  for (const auto& [name, value] : from.params) {
    request.query.emplace(name, value);
  }
  request.host = from.get_header_value("Host");
  request.fetch_site = from.get_header_value("Sec-Fetch-Site");
  request.known_etags = from.get_header_value("If-None-Match");
  request.certificate =
      from.ssl == nullptr ? std::string() : security::WebGate::certificate_of(*from.ssl);
  return request;
}

void send(HttpAnswer answer, httplib::Response& to) {
  to.status = answer.status;
  for (const auto& [name, value] : answer.headers) {
    to.set_header(name, value);
  }
  if (answer.stream) {
    to.set_chunked_content_provider(
        answer.content_type,
        [stream = std::move(answer.stream)](std::size_t /*offset*/, httplib::DataSink& sink) {
          bool is_there = true;
          const bool goes_on = stream([&](std::string_view bytes) {
            is_there = is_there && sink.write(bytes.data(), bytes.size());
            return is_there;
          });
          if (!goes_on && is_there) {
            sink.done();
          }
          return is_there;
        });
    return;
  }
  if (answer.body.empty()) {
    to.set_header("Content-Type", answer.content_type);
    return;
  }
  // Not set_content: that would compress, at brotli's slowest, what is read once.
  auto body = std::make_shared<const std::string>(std::move(answer.body));
  to.set_content_provider(body->size(), answer.content_type,
                          [body](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
                            return sink.write(body->data() + offset,
                                              std::min(length, body->size() - offset));
                          });
}

std::unique_ptr<httplib::Server> new_server(security::WebGate& gate) {
  if (!gate.speaks_tls()) {
    return std::make_unique<httplib::Server>();
  }
  return std::make_unique<httplib::SSLServer>([&gate](SSL_CTX& context) {
    gate.prepare(context);
    return true;
  });
}

}  // namespace

struct HttpServer::Insides {
  std::unique_ptr<httplib::Server> server;
  std::thread listener;
  std::atomic<bool> has_ended = false;
};

HttpServer::HttpServer(const security::Endpoint& listen, security::WebGate& gate, Handler handler)
    : insides_(std::make_unique<Insides>()) {
  insides_->server = new_server(gate);
  httplib::Server& server = *insides_->server;
  server.new_task_queue = [] { return std::make_unique<BoundedQueue>(kHttpThreads).release(); };
  // One request a connection: a kept one would hold a thread while nothing comes, and what follows
  // a request that we do not read to its end is not taken for another.
  server.set_keep_alive_max_count(1);
  server.set_keep_alive_timeout(kIdleSeconds);
  server.set_read_timeout(kSilenceSeconds);
  server.set_write_timeout(kSilenceSeconds);
  server.set_payload_max_length(kBodyLimitBytes);
  server.set_tcp_nodelay(true);
  // Two servers must not share a port, which httplib would let them.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  });
  server.set_pre_routing_handler(
      [answer = std::move(handler)](const httplib::Request& request, httplib::Response& response) {
        send(answer(request_of(request)), response);
        return httplib::Server::HandlerResponse::Handled;
      });

  const std::size_t colon = listen.address.rfind(':');
  std::string host = listen.address.substr(0, colon);
  int port = std::stoi(listen.address.substr(colon + 1));
  const std::string shown = host;
  if (host.starts_with('[') && host.ends_with(']')) {
    host = host.substr(1, host.size() - 2);
  }
  if (port == 0) {
    port = server.bind_to_any_port(host);
  } else if (!server.bind_to_port(host, port)) {
    port = -1;
  }
  if (port <= 0) {
    throw core::Error(core::Code::kUnavailable,
                      "the page cannot be at " + listen.address +
                          "; is another program using the port? Name another with --http, or say "
                          "--http off");
  }
  address_ = shown + ":" + std::to_string(port);
  insides_->listener = std::thread([&server, &insides = *insides_] {
    if (!server.listen_after_bind()) {
      spdlog::error("event=page_ended message=\"connections cannot be accepted any more\"");
    }
    insides.has_ended = true;
  });
}

HttpServer::~HttpServer() { stop(); }

void HttpServer::stop() {
  if (!insides_->listener.joinable()) {
    return;
  }
  // httplib's stop does nothing before its listener runs.
  while (!insides_->server->is_running() && !insides_->has_ended) {
    std::this_thread::yield();
  }
  insides_->server->stop();
  insides_->listener.join();
}

}  // namespace weft::coordinator
