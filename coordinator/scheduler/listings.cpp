#include "coordinator/scheduler/listings.h"

#include <filesystem>
#include <set>

#include <google/protobuf/util/json_util.h>

#include "coordinator/scheduler/messages.h"
#include "coordinator/versions/description_changes.h"
#include "core/error.h"
#include "proto/limits.h"
#include "proto/weft/v1/fabric.pb.h"
#include "storage/database_diff.h"

namespace weft::coordinator {

namespace {

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

v1::ListFabricsResponse list_fabrics(Catalogue& catalogue) {
  v1::ListFabricsResponse response;
  for (const VersionRecord& latest : catalogue.latest_versions()) {
    v1::Fabric& fabric = *response.add_fabrics();
    fabric.set_name(latest.fabric);
    fabric.set_versions(catalogue.versions(latest.fabric).size());
    *fabric.mutable_latest() = message_of(latest);
  }
  return response;
}

v1::ListVersionsResponse list_versions(Catalogue& catalogue, const std::string& fabric) {
  (void)catalogue.find(fabric + "@latest");  // says it well when there is none
  v1::ListVersionsResponse response;
  for (const VersionRecord& version : catalogue.versions(fabric)) {
    *response.add_versions() = message_of(version);
  }
  return response;
}

v1::ListHistoryResponse list_history(Catalogue& catalogue, const std::string& fabric,
                                     std::uint32_t limit) {
  (void)catalogue.find(fabric + "@latest");  // says it well when there is none
  const bool has_limit = limit > 0 && limit < v1::kListLimit;
  v1::ListHistoryResponse response;
  for (const HistoryRecord& step : catalogue.history(fabric, has_limit ? limit : v1::kListLimit)) {
    *response.add_entries() = message_of(step);
  }
  return response;
}

v1::DiffVersionsResponse diff_versions(Catalogue& catalogue, const std::string& from_reference,
                                       const std::string& to_reference) {
  v1::DiffVersionsResponse response;
  const VersionRecord from = catalogue.find(from_reference);
  const VersionRecord to = catalogue.find(to_reference);
  *response.mutable_from() = message_of(from);
  *response.mutable_to() = message_of(to);
  std::set<core::Digest> of_from;
  for (const storage::Piece& piece : catalogue.pieces_of(from)) {
    of_from.insert(piece.digest);
  }
  std::uint64_t shared_bytes = 0;
  for (const storage::Piece& piece : catalogue.pieces_of(to)) {
    shared_bytes += of_from.contains(piece.digest) ? piece.size_bytes : 0;
  }
  response.set_shared_bytes(shared_bytes);
  catalogue.with_files({from, to}, [&](const std::vector<std::filesystem::path>& files) {
    compare(files[0], files[1], response);
  });
  return response;
}

}  // namespace weft::coordinator
