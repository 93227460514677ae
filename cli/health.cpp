#include <future>
#include <memory>
#include <string>

#include <fmt/format.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "core/error.h"
#include "security/channel.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Ask whether a coordinator or a render node serves, for probes.\n"
    "Asks gRPC's health service (grpc.health.v1), with certificates where the service wants them, "
    "as "
    "a\n"
    "probe of a container that has none cannot. Exits with 0 when it serves, 5 when it does not "
    "or\n"
    "does not answer.\n"
    "Example: weft health --coordinator 127.0.0.1:7411";

struct HealthOptions {
  security::Endpoint service;
  std::uint32_t seconds = 5;
};

// HealthCheckResponse of grpc/health/v1/health.proto with status SERVING, on the wire.
constexpr const char* kServing = "\x08\x01";

std::string bytes_of(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  std::string bytes;
  if (buffer.Dump(&slices).ok()) {
    for (const grpc::Slice& slice : slices) {
      bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
    }
  }
  return bytes;
}

void run(const HealthOptions& options) {
  grpc::GenericStub stub(security::open_channel(options.service));
  grpc::ClientContext context;
  Client::set_deadline(context, std::chrono::seconds(options.seconds));
  const grpc::Slice nothing;  // HealthCheckRequest of the whole server
  const grpc::ByteBuffer request(&nothing, 1);
  grpc::ByteBuffer response;
  std::promise<grpc::Status> ended;
  stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", {}, &request, &response,
                 [&ended](const grpc::Status& status) { ended.set_value(status); });
  const grpc::Status status = ended.get_future().get();
  if (!status.ok()) {
    throw core::Error(core::Code::kUnavailable,
                      fmt::format("nothing that serves answers at {}: {}", options.service.address,
                                  status.error_message()));
  }
  if (bytes_of(response) != kServing) {
    throw core::Error(core::Code::kUnavailable,
                      fmt::format("{} does not serve: it stops, or cannot write its state; its log "
                                  "says more",
                                  options.service.address));
  }
  fmt::print("{} serves\n", options.service.address);
}

}  // namespace

void add_health(CLI::App& app) {
  auto options = std::make_shared<HealthOptions>();
  CLI::App* command = add_command(app, "health", kHelp);
  add_coordinator_option(*command, options->service);
  command->add_option("--seconds", options->seconds, "How long it may take to answer")
      ->check(CLI::Range(1U, 60U))
      ->capture_default_str();
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
