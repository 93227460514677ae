#include "client/fetch_version.h"

#include <chrono>
#include <memory>
#include <system_error>
#include <thread>

#include "client/fetch_pieces.h"
#include "client/part_file.h"
#include "core/error.h"
#include "core/file.h"
#include "proto/names.h"
#include "storage/fabric_database.h"

namespace weft::client {

namespace {

// One stream, from what is here to wherever it breaks off.
grpc::Status stream_rest(Coordinator& coordinator, const v1::Version& version, PartFile& part,
                         const FetchReport& report) {
  v1::FetchVersionRequest request;
  request.set_reference(reference_text(version));
  request.set_offset(part.size_bytes());
  grpc::ClientContext context;
  set_deadline(context, version.size_bytes());
  const auto reader = coordinator.catalogue().FetchVersion(&context, request);
  v1::FetchVersionResponse response;
  while (reader->Read(&response)) {
    if (part.size_bytes() + response.data().size() > version.size_bytes()) {
      context.TryCancel();
      (void)reader->Finish();
      part.shorten(0);
      throw core::Error(core::Code::kDataLoss,
                        reference_text(version) + ": more bytes came than the version has");
    }
    part.append(response.data());
    try {
      if (report) {
        report(part.size_bytes(), version.size_bytes());
      }
    } catch (...) {
      context.TryCancel();
      (void)reader->Finish();
      throw;
    }
  }
  return reader->Finish();
}

// From a coordinator that knows of no pieces.
void fetch_stream(Coordinator& coordinator, const v1::Version& version, PartFile& part,
                  const FetchReport& report, FetchOutcome& outcome) {
  if (part.size_bytes() > version.size_bytes()) {
    part.shorten(0);
  }
  outcome.bytes_kept = part.size_bytes();
  Patience patience(coordinator, "fetch " + reference_text(version));
  while (part.size_bytes() < version.size_bytes()) {
    const std::uint64_t before = part.size_bytes();
    const grpc::Status status = stream_rest(coordinator, version, part, report);
    if (part.size_bytes() < version.size_bytes()) {
      patience.wait(status, part.size_bytes() > before);
    }
  }
  outcome.bytes_fetched = version.size_bytes() - outcome.bytes_kept;
}

// What came is read whole before it gets its name; a file that has it was, and its digest says that
// it is the same.
enum class Checked { kBytes, kContents };

bool is_this_version(const std::filesystem::path& path, const v1::Version& version,
                     Checked checked) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure) ||
      std::filesystem::file_size(path, failure) != version.size_bytes()) {
    return false;
  }
  try {
    const core::Digest digest = checked == Checked::kContents ? storage::verify_database(path)
                                                              : storage::checked_digest(path);
    return digest == version_digest(version);
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kDataLoss && error.code() != core::Code::kNotFound) {
      throw;  // it could not be checked: that says nothing about the file
    }
    return false;
  }
}

}  // namespace

std::string reference_text(const v1::Version& version) {
  return version.fabric() + "@" + std::to_string(version.number());
}

v1::Version find_version(Coordinator& coordinator, const std::string& reference) {
  v1::GetVersionRequest request;
  request.set_reference(reference);
  const v1::GetVersionResponse response =
      coordinator.call(coordinator.catalogue(), &v1::CatalogueService::Stub::GetVersion, request,
                       "look up " + reference);
  // The name becomes a file's: what a coordinator says is not believed to be one.
  if (!v1::is_fabric_name(response.version().fabric())) {
    throw core::Error(core::Code::kDataLoss, "the coordinator's answer about " + reference +
                                                 " names no fabric; is it a coordinator of weft?");
  }
  return response.version();
}

core::Digest version_digest(const v1::Version& version) {
  const auto digest = core::Digest::from_binary(version.content_digest());
  if (!digest) {
    throw core::Error(
        core::Code::kDataLoss,
        "the coordinator's answer about " + reference_text(version) + " has no content digest");
  }
  return *digest;
}

FetchOutcome fetch_version(Coordinator& coordinator, const v1::Version& version,
                           const std::filesystem::path& path, const FetchReport& report,
                           PieceIndex here) {
  const core::Digest digest = version_digest(version);
  FetchOutcome outcome;
  if (is_this_version(path, version, Checked::kBytes)) {
    outcome.was_there = true;
    return outcome;
  }
  PartFile part(path.string() + "." + digest.hex().substr(0, 16) + ".part");
  const std::optional<std::vector<storage::Piece>> pieces = manifest_of(coordinator, version);
  if (pieces) {
    here.add_database(path);
    PieceFetch fetch(coordinator, version, *pieces, part, std::move(here));
    fetch.run(report, outcome);
    outcome.pieces = *pieces;
  } else {
    fetch_stream(coordinator, version, part, report, outcome);
  }
  if (!is_this_version(part.path(), version, Checked::kContents)) {
    part.shorten(0);
    throw core::Error(core::Code::kDataLoss,
                      "what came of " + reference_text(version) +
                          " is not what was published; it was thrown away, fetch it again");
  }
  core::publish_file(part.path(), path);
  return outcome;
}

}  // namespace weft::client
