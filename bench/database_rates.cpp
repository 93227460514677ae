// How fast fabric databases are written, read and cut into pieces, and how fast their datasets are
// unfolded beside HDF5's own filters. Usage: bench_database_rates A.h5

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <hdf5.h>

#include "core/check.h"
#include "core/clock.h"
#include "core/digest.h"
#include "core/error.h"
#include "core/file.h"
#include "core/resource_use.h"
#include "storage/database_parser.h"
#include "storage/database_summary.h"
#include "storage/fabric_database.h"
#include "storage/h5_reader.h"
#include "storage/pieces.h"
#include "storage/recolouring.h"
#include "storage/user_block.h"

namespace {

namespace core = weft::core;
namespace storage = weft::storage;

// Prints what `work` takes for a file of so many bytes.
template <class Work>
void measure(const char* name, double megabytes, const Work& work) {
  const core::Stopwatch since_start;
  const double cpu_before = core::process_cpu_seconds();
  work();
  const double seconds = since_start.seconds();
  fmt::print("{:8} {:6.3f} s, {:6.3f} s of CPU, {:6.1f} MB/s\n", name, seconds,
             core::process_cpu_seconds() - cpu_before, megabytes / seconds);
}

// The digest of all datasets as our reader unfolds them.
core::Digest unfolded(const std::string& file, const std::vector<storage::StoredDataset>& datasets,
                      storage::h5::Decoding decoding, double& seconds) {
  storage::h5::Reader reader(std::as_bytes(std::span(file)), storage::kUserBlockBytes, decoding);
  core::Hasher hasher;
  for (const storage::StoredDataset& dataset : datasets) {
    const storage::DatasetSource::Info info = reader.info(dataset.path);
    std::vector<std::byte> data(info.bytes);
    const core::Stopwatch since_start;
    reader.read(dataset.path, info, data);
    seconds += since_start.seconds();
    hasher.bytes({reinterpret_cast<const char*>(data.data()), data.size()});
  }
  return hasher.finish();
}

// The same as HDF5 does.
core::Digest unfolded_by_the_library(const std::filesystem::path& path,
                                     const std::vector<storage::StoredDataset>& datasets,
                                     double& seconds) {
  using storage::h5::Handle;
  const storage::h5::Session session;
  const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  core::Hasher hasher;
  for (const storage::StoredDataset& stored : datasets) {
    const Handle dataset(H5Dopen2(file.id(), stored.path.c_str(), H5P_DEFAULT));
    const Handle type(H5Dget_type(dataset.id()));
    const Handle space(H5Dget_space(dataset.id()));
    std::vector<char> data(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space.id())) *
                           H5Tget_size(type.id()));
    const core::Stopwatch since_start;
    CHECK_GE(H5Dread(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data()), 0);
    seconds += since_start.seconds();
    hasher.bytes({data.data(), data.size()});
  }
  return hasher.finish();
}

// The best of some turns each.
void compare_with_the_library(const std::filesystem::path& path) {
  constexpr int kTurns = 3;
  const std::string file = core::read_file(path);
  const std::vector<storage::StoredDataset> datasets = storage::stored_datasets(path);
  double library_s = 0;
  double alone_s = 0;
  double all_s = 0;
  for (int turn = 0; turn < kTurns; ++turn) {
    const auto keep = [turn](double& best, double seconds) {
      best = turn == 0 ? seconds : std::min(best, seconds);
    };
    double seconds = 0;
    const core::Digest expected = unfolded_by_the_library(path, datasets, seconds);
    keep(library_s, seconds);
    seconds = 0;
    CHECK(unfolded(file, datasets, storage::h5::Decoding::kInThisThread, seconds) == expected);
    keep(alone_s, seconds);
    seconds = 0;
    CHECK(unfolded(file, datasets, storage::h5::Decoding::kByAllThreads, seconds) == expected);
    keep(all_s, seconds);
  }
  fmt::print(
      "datasets unfold in {:.3f} s by HDF5's filters, {:.3f} s by ours in one thread ({:.2f} times "
      "as fast), {:.3f} s by all threads ({:.2f} times)\n",
      library_s, alone_s, library_s / alone_s, all_s, library_s / all_s);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "bench_database_rates: give one database\n");
    return 2;
  }
  const std::filesystem::path path = argv[1];
  const std::filesystem::path again = path.string() + ".again";
  try {
    const double megabytes = static_cast<double>(std::filesystem::file_size(path)) / 1e6;
    storage::RecolourableDatabase all;
    measure("read", megabytes, [&] { all = storage::read_recolourable(path); });
    const std::string file = core::read_file(path);
    // As a coordinator reads what it has written.
    measure("verify", megabytes,
            [&] { static_cast<void>(storage::parse_database_here(file, path.string())); });
    core::Digest digest;
    measure("write", megabytes,
            [&] { digest = storage::write_database(all.database, all.recolouring, again); });
    std::size_t pieces = 0;
    measure("cut", megabytes, [&] { pieces = storage::cut_file(again, {}).size(); });
    compare_with_the_library(path);
    fmt::print("{:.1f} MB, {} pieces, content {}\n", megabytes, pieces, digest.hex());
  } catch (const core::Error& error) {
    fmt::print(stderr, "bench_database_rates: {}\n", error.what());
    return 1;
  }
  std::filesystem::remove(again);
  return 0;
}
