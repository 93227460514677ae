#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/support/status.h>

#include "proto/weft/v1/cluster.grpc.pb.h"
#include "security/endpoint.h"

namespace weft::client {

inline constexpr std::chrono::seconds kCallDeadline{20};

// A connection to the coordinator, made when it is first used. Any thread may call.
class Coordinator {
 public:
  // Throws what security::open_channel throws.
  explicit Coordinator(security::Endpoint endpoint);

  [[nodiscard]] const std::string& address() const { return endpoint_.address; }
  [[nodiscard]] v1::JobService::Stub& jobs() { return *jobs_; }
  [[nodiscard]] v1::WorkersService::Stub& workers() { return *workers_; }
  [[nodiscard]] v1::CatalogueService::Stub& catalogue() { return *catalogue_; }

  // Throws core::Error for every status but OK. When the coordinator is away the message says how
  // to start one; the code is then kUnavailable.
  void check(const grpc::Status& status, const std::string& doing) const;

  // One call with a deadline. `doing` ("list the jobs") stands in the message when it fails.
  template <class Stub, class Request, class Response>
  Response call(Stub& stub,
                grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                const Request& request, const std::string& doing) const {
    grpc::ClientContext context;
    set_deadline(context, kCallDeadline);
    Response response;
    check((stub.*method)(&context, request, &response), doing);
    return response;
  }

  // The same for a request that carries a request_id: while it is not known whether the call
  // arrived, it is made again, a few times.
  template <class Stub, class Request, class Response>
  Response call_repeatedly(Stub& stub,
                           grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                        Response*),
                           const Request& request, const std::string& doing) const {
    for (int tries_left = kTries; true; --tries_left) {
      grpc::ClientContext context;
      set_deadline(context, kCallDeadline);
      Response response;
      const grpc::Status status = (stub.*method)(&context, request, &response);
      if (tries_left == 1 || !is_worth_repeating(status)) {
        check(status, doing);
        return response;
      }
      std::this_thread::sleep_for(kBetweenTries);
    }
  }

  static void set_deadline(grpc::ClientContext& context, std::chrono::seconds from_now);

  // Whether the call may succeed when it is made again.
  [[nodiscard]] static bool is_worth_repeating(const grpc::Status& status);

 private:
  static constexpr int kTries = 3;
  static constexpr std::chrono::milliseconds kBetweenTries{300};

  security::Endpoint endpoint_;
  std::shared_ptr<grpc::Channel> channel_;  // shared: gRPC's stubs ask for it
  std::unique_ptr<v1::JobService::Stub> jobs_;
  std::unique_ptr<v1::WorkersService::Stub> workers_;
  std::unique_ptr<v1::CatalogueService::Stub> catalogue_;
};

// A name for one intention (cluster.proto, request_id): 32 random hexadecimal digits.
[[nodiscard]] std::string new_request_id();

}  // namespace weft::client
