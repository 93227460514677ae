// How fast fabric databases are written, read and cut into pieces. Usage: bench_database_rates A.h5

#include <cstdio>
#include <filesystem>

#include <fmt/format.h>

#include "core/clock.h"
#include "core/error.h"
#include "core/resource_use.h"
#include "storage/fabric_database.h"
#include "storage/pieces.h"
#include "storage/recolouring.h"

namespace {

using namespace weft;

// Prints what `work` takes for a file of so many bytes.
template <class Work>
void measure(const char* name, double megabytes, const Work& work) {
  const core::Stopwatch since_start;
  const double cpu_before = core::process_cpu_seconds();
  work();
  const double seconds = since_start.seconds();
  fmt::print("{:6} {:6.2f} s, {:6.2f} s of CPU, {:6.1f} MB/s\n", name, seconds,
             core::process_cpu_seconds() - cpu_before, megabytes / seconds);
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
    core::Digest digest;
    measure("write", megabytes,
            [&] { digest = storage::write_database(all.database, all.recolouring, again); });
    std::size_t pieces = 0;
    measure("cut", megabytes, [&] { pieces = storage::cut_file(again, {}).size(); });
    fmt::print("{:.1f} MB, {} pieces, content {}\n", megabytes, pieces, digest.hex());
  } catch (const core::Error& error) {
    fmt::print(stderr, "bench_database_rates: {}\n", error.what());
    return 1;
  }
  std::filesystem::remove(again);
  return 0;
}
