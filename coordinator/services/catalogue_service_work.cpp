#include <spdlog/spdlog.h>

#include "coordinator/scheduler/garbage.h"
#include "coordinator/scheduler/listings.h"
#include "coordinator/scheduler/messages.h"
#include "coordinator/services/catalogue_service.h"
#include "coordinator/services/rpc.h"
#include "coordinator/versions/colourway_arrival.h"
#include "core/clock.h"
#include "core/error.h"
#include "proto/limits.h"

// The catalogue's calls that take a while: comparing versions, taking in colourways, and collecting
// garbage.

namespace weft::coordinator {

namespace {

constexpr std::int64_t kMsPerSecond = 1000;
constexpr std::uint64_t kUsualGraceSeconds = std::uint64_t{24} * 3600;
constexpr std::uint64_t kUsualKeepSeconds = 30 * kUsualGraceSeconds;

std::uint64_t seconds_or(std::uint64_t given, std::uint64_t usual, const char* field) {
  if (given == 0) {
    return usual;
  }
  if (given < v1::kGraceLeastSeconds || given > v1::kGraceLimitSeconds) {
    throw core::Error(core::Code::kInvalidArgument,
                      std::string(field) + " is " + std::to_string(given) + "; it is from " +
                          std::to_string(v1::kGraceLeastSeconds) + " to " +
                          std::to_string(v1::kGraceLimitSeconds));
  }
  return given;
}

}  // namespace

grpc::Status CatalogueService::DiffVersions(grpc::ServerContext* context,
                                            const v1::DiffVersionsRequest* request,
                                            v1::DiffVersionsResponse* response) {
  return answer(*context, "CatalogueService.DiffVersions", [&] {
    *response = diff_versions(catalogue_, request->from(), request->to());
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::PublishColourway(
    grpc::ServerContext* context, grpc::ServerReader<v1::PublishColourwayRequest>* reader,
    v1::PublishColourwayResponse* response) {
  return answer(*context, "CatalogueService.PublishColourway", [&](const security::Caller& caller) {
    const OpenStreams::Ticket ticket = colourways_.enter(*context);
    v1::PublishColourwayRequest request;
    if (!reader->Read(&request)) {
      return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "the stream has no message");
    }
    ColourwayClaim claim{
        order_of(request.request_id(), caller, request.comment()), request.fabric(), request.base(),
        digest_from(request.content_digest(), "content_digest"), request.size_bytes()};
    if (const auto before = catalogue_.done_before(claim.order)) {
      *response->mutable_version() = message_of(*before);
      return grpc::Status::OK;
    }
    scheduler_.check_journal_limit();
    ColourwayArrival arrival(catalogue_, std::move(claim));
    do {
      if (request.data().size() > v1::kChunkLimitBytes) {
        return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "a chunk is larger than 1 MiB");
      }
      arrival.add(request.data());
    } while (reader->Read(&request));
    const std::lock_guard one_at_a_time(checking_);
    const VersionRecord version = arrival.publish();
    spdlog::info("version={}@{} event=published digest={} bytes={} carried_over_from={} user={}",
                 version.fabric, version.number, version.content_digest.hex(), version.size_bytes,
                 version.carried_over_from, version.user);
    *response->mutable_version() = message_of(version);
    return grpc::Status::OK;
  });
}

grpc::Status CatalogueService::CollectGarbage(grpc::ServerContext* context,
                                              const v1::CollectGarbageRequest* request,
                                              v1::CollectGarbageResponse* response) {
  return answer(*context, "CatalogueService.CollectGarbage", [&] {
    check_id(request->request_id(), "request_id");
    GarbageOrder order;
    order.is_dry_run = request->dry_run();
    order.empties_trash = request->empty_trash();
    order.now_ms = to_ms(core::system_clock().now());
    order.grace_ms =
        kMsPerSecond * static_cast<std::int64_t>(seconds_or(request->grace_seconds(),
                                                            kUsualGraceSeconds, "grace_seconds"));
    order.keep_unpublished_ms = kMsPerSecond * static_cast<std::int64_t>(seconds_or(
                                                   request->keep_unpublished_seconds(),
                                                   kUsualKeepSeconds, "keep_unpublished_seconds"));
    const std::lock_guard one_at_a_time(collecting_);
    const GarbageReport report = collect_garbage(scheduler_, order);
    response->set_blobs_kept(report.kept);
    response->set_bytes_kept(report.kept_bytes);
    response->set_blobs_removed(report.removed);
    response->set_bytes_removed(report.removed_bytes);
    response->set_trash_blobs_removed(report.emptied);
    response->set_trash_bytes_removed(report.emptied_bytes);
    response->mutable_examples()->Assign(report.examples.begin(), report.examples.end());
    return grpc::Status::OK;
  });
}

}  // namespace weft::coordinator
