#pragma once

#include <map>
#include <mutex>
#include <string>

#include <grpcpp/server_context.h>

namespace weft::coordinator {

// How many calls of one kind run at the same time, in all and for each connection: each of them
// holds a thread and a chunk of memory for as long as its caller takes. Any thread.
class OpenStreams {
 public:
  // `name` is what the limits are called: "fetches" has fetches_limit and
  // fetches_per_connection_limit.
  OpenStreams(std::string name, int limit, int limit_per_connection);

  // One call, counted while it lives.
  class Ticket {
   public:
    Ticket(OpenStreams& streams, std::string peer);
    ~Ticket();
    Ticket(const Ticket&) = delete;
    Ticket& operator=(const Ticket&) = delete;
    Ticket(Ticket&&) = delete;
    Ticket& operator=(Ticket&&) = delete;

   private:
    OpenStreams& streams_;
    std::string peer_;
  };

  // Throws core::Error(kResourceExhausted) with the name of the limit when there are so many
  // already. Connections by a Unix socket cannot be told apart, and have the common limit only.
  [[nodiscard]] Ticket enter(const grpc::ServerContextBase& context);

 private:
  const std::string name_;
  const int limit_;
  const int limit_per_connection_;
  std::mutex mutex_;  // guards all below
  int open_ = 0;
  std::map<std::string, int> open_of_peer_;
};

}  // namespace weft::coordinator
