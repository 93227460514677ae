// bench_version_load: how fast versions and blobs go to the disk and over loopback. Publishes a
// file of noise, with its pieces synced together and each alone; fetches it from the real program
// as one stream and by pieces; stores and reads a blob. Usage: bench_version_load BIN_DIR [MIB]
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <unistd.h>

#include "bench/coordinator_process.h"
#include "client/coordinator.h"
#include "client/fetch_pieces.h"
#include "client/part_file.h"
#include "coordinator/versions/catalogue.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/file.h"
#include "proto/limits.h"
#include "proto/status.h"

namespace weft::bench {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr int kRepetitions = 3;

std::string noise(std::size_t bytes) {
  std::string data(bytes, '\0');
  std::uint64_t state = 1;
  for (char& byte : data) {
    state = state * 6364136223846793005 + 1442695040888963407;
    byte = static_cast<char>(state >> 56);
  }
  return data;
}

coordinator::Publication publication_of(const std::filesystem::path& file,
                                        const std::string& content) {
  core::write_file_atomically(file, content);
  coordinator::Publication publication;
  publication.fabric = "noise";
  publication.content_digest = core::digest_of(content);
  publication.file = file;
  publication.job = "j1";
  return publication;
}

// What publishing costs, and what it would cost if each piece were synced alone.
void measure_publishing(const std::filesystem::path& state, const std::string& content) {
  std::filesystem::create_directories(state);
  coordinator::Journal journal(state / "journal.db");
  coordinator::Catalogue catalogue(journal, state);
  coordinator::Publication publication = publication_of(state / "noise.h5", content);
  storage::BlobStore alone(state / "alone");
  const core::Stopwatch alone_watch;
  const auto put = [&](const storage::Piece& /*piece*/, std::string_view bytes) {
    (void)alone.put(bytes);
  };
  (void)storage::cut_file(publication.file, put);
  const double alone_seconds = alone_watch.seconds();
  const core::Stopwatch watch;
  catalogue.prepare(publication);
  (void)catalogue.publish(publication);
  std::printf("publish: %zu MiB in %zu pieces, %.2f s together, %.2f s when each is synced alone\n",
              content.size() / kMiB, publication.pieces.size(), watch.seconds(), alone_seconds);
  std::filesystem::remove_all(state / "alone");
}

void measure_fetching(const CoordinatorProcess& process, const std::filesystem::path& folder) {
  client::Coordinator coordinator(process.address());
  const v1::Version version = client::find_version(coordinator, "noise");
  const auto mebibytes = static_cast<double>(version.size_bytes()) / kMiB;
  for (int i = 0; i < kRepetitions; ++i) {
    v1::FetchVersionRequest request;
    request.set_reference("noise");
    grpc::ClientContext context;
    client::set_deadline(context, version.size_bytes());
    const double cpu_before = process.cpu_seconds();
    const core::Stopwatch watch;
    const auto reader = coordinator.catalogue().FetchVersion(&context, request);
    for (v1::FetchVersionResponse response; reader->Read(&response);) {
    }
    v1::throw_unless_ok(reader->Finish(), "fetch");
    std::printf("fetch: %.0f MiB/s as one stream", mebibytes / watch.seconds());
    const double cpu_between = process.cpu_seconds();
    const core::Stopwatch piece_watch;
    const auto pieces = client::manifest_of(coordinator, version);
    client::PartFile part(folder / "part");
    part.shorten(0);
    client::FetchOutcome outcome;
    client::PieceFetch(coordinator, version, pieces.value(), part, {}).run({}, outcome);
    std::printf(", %.0f MiB/s by pieces into a file; %.2f and %.2f ms of the coordinator a MiB\n",
                mebibytes / piece_watch.seconds(), 1e3 * (cpu_between - cpu_before) / mebibytes,
                1e3 * (process.cpu_seconds() - cpu_between) / mebibytes);
  }
}

void measure_blobs(const CoordinatorProcess& process, const std::string& content) {
  const auto blobs = v1::BlobService::NewStub(process.connect());
  const core::Digest digest = core::digest_of(content);
  grpc::ClientContext writing;
  client::set_deadline(writing, content.size());
  v1::WriteResponse written;
  const double cpu_before = process.cpu_seconds();
  const core::Stopwatch write_watch;
  const auto writer = blobs->Write(&writing, &written);
  v1::WriteRequest request;
  request.set_digest(digest.binary());
  request.set_size_bytes(content.size());
  for (std::size_t at = 0; at < content.size(); at += v1::kChunkLimitBytes) {
    request.set_data(content.substr(at, v1::kChunkLimitBytes));
    if (!writer->Write(request)) {
      break;
    }
    request.Clear();
  }
  const double sent_seconds = write_watch.seconds();
  writer->WritesDone();
  v1::throw_unless_ok(writer->Finish(), "write a blob");
  const double write_seconds = write_watch.seconds();
  const double cpu_between = process.cpu_seconds();
  grpc::ClientContext reading;
  client::set_deadline(reading, content.size());
  v1::ReadRequest read;
  read.set_digest(digest.binary());
  const core::Stopwatch watch;
  const auto reader = blobs->Read(&reading, read);
  for (v1::ReadResponse response; reader->Read(&response);) {
  }
  v1::throw_unless_ok(reader->Finish(), "read a blob");
  const double read_seconds = watch.seconds();
  const double mebibytes = static_cast<double>(content.size()) / kMiB;
  std::printf(
      "blobs: %.0f MiB/s written (%.0f %% of the time until the last byte is sent), %.0f MiB/s "
      "read; %.2f and %.2f ms of the coordinator a MiB\n",
      mebibytes / write_seconds, 100 * sent_seconds / write_seconds, mebibytes / read_seconds,
      1e3 * (cpu_between - cpu_before) / mebibytes,
      1e3 * (process.cpu_seconds() - cpu_between) / mebibytes);
}

void run(const std::filesystem::path& programs, std::size_t mebibytes) {
  std::string name = (std::filesystem::temp_directory_path() / "weft_load_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw core::Error(core::Code::kUnavailable, "no temporary folder");
  }
  const std::filesystem::path folder = name;
  const std::string content = noise(mebibytes * kMiB);
  measure_publishing(folder / "state", content);
  CoordinatorProcess process(programs / "weft-coordinator", folder / "state");
  process.start();
  measure_fetching(process, folder);
  measure_blobs(process, content);
  process.kill();
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace weft::bench

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: bench_version_load BIN_DIR [MIB]\n";
    return 2;
  }
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  try {
    weft::bench::run(argv[1], argc > 2 ? std::stoull(argv[2]) : 256);
  } catch (const std::exception& error) {
    std::cerr << "bench_version_load: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
