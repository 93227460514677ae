#include <set>

#include <google/protobuf/util/json_util.h>

#include "coordinator/scheduler/garbage.h"
#include "coordinator/scheduler/messages.h"
#include "coordinator/services/catalogue_service.h"
#include "coordinator/services/rpc.h"
#include "coordinator/versions/description_changes.h"
#include "core/clock.h"
#include "core/error.h"
#include "proto/limits.h"
#include "proto/weft/v1/fabric.pb.h"
#include "storage/database_diff.h"

// The catalogue's calls that take a while: comparing versions, and collecting garbage.

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

v1::FabricDescription description_of(const std::filesystem::path& file) {
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;  // an older weft's
  v1::FabricDescription description;
  const auto status = google::protobuf::util::JsonStringToMessage(storage::description_json(file),
                                                                  &description, options);
  if (!status.ok()) {
    throw core::Error(core::Code::kDataLoss,
                      "the description in the database cannot be read: " + status.ToString());
  }
  return description;
}

std::string shape_text(const storage::h5::Shape& shape) {
  return shape.empty() ? std::string() : storage::h5::to_string(shape);
}

void compare(const std::filesystem::path& from, const std::filesystem::path& to,
             v1::DiffVersionsResponse& response) {
  for (const FieldDifference& field : differences_of(description_of(from), description_of(to))) {
    v1::FieldChange& change = *response.add_fields();
    change.set_path(field.path);
    change.set_from(field.from);
    change.set_to(field.to);
  }
  for (const storage::DatasetDifference& dataset : storage::diff_databases(from, to)) {
    v1::DatasetChange& change = *response.add_datasets();
    change.set_path(dataset.path);
    change.set_equal(dataset.is_equal);
    change.set_shape_from(shape_text(dataset.shape_from));
    change.set_shape_to(shape_text(dataset.shape_to));
    change.set_largest_difference(dataset.largest);
    change.set_rms_difference(dataset.rms);
    change.set_rms_from(dataset.rms_from);
  }
}

}  // namespace

grpc::Status CatalogueService::DiffVersions(grpc::ServerContext* context,
                                            const v1::DiffVersionsRequest* request,
                                            v1::DiffVersionsResponse* response) {
  return answer(*context, "CatalogueService.DiffVersions", [&] {
    const VersionRecord from = catalogue_.find(request->from());
    const VersionRecord to = catalogue_.find(request->to());
    *response->mutable_from() = message_of(from);
    *response->mutable_to() = message_of(to);
    std::set<core::Digest> of_from;
    for (const storage::Piece& piece : catalogue_.pieces_of(from)) {
      of_from.insert(piece.digest);
    }
    std::uint64_t shared_bytes = 0;
    for (const storage::Piece& piece : catalogue_.pieces_of(to)) {
      shared_bytes += of_from.contains(piece.digest) ? piece.size_bytes : 0;
    }
    response->set_shared_bytes(shared_bytes);
    catalogue_.with_files({from, to}, [&](const std::vector<std::filesystem::path>& files) {
      compare(files[0], files[1], *response);
    });
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
