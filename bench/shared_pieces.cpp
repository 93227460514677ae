// What fabric databases share when they are kept as pieces. Usage: bench_shared_pieces A.h5 B.h5
// ...

#include <cstdio>
#include <filesystem>
#include <set>

#include <fmt/format.h>

#include "core/error.h"
#include "storage/pieces.h"

int main(int argc, char** argv) {
  using namespace weft;
  std::set<core::Digest> known;
  std::uint64_t total_bytes = 0;
  std::uint64_t stored_bytes = 0;
  try {
    for (int i = 1; i < argc; ++i) {
      std::uint64_t new_bytes = 0;
      const std::vector<storage::Piece> pieces = storage::cut_file(argv[i], {});
      for (const storage::Piece& piece : pieces) {
        new_bytes += known.insert(piece.digest).second ? piece.size_bytes : 0;
      }
      const std::uint64_t bytes = std::filesystem::file_size(argv[i]);
      total_bytes += bytes;
      stored_bytes += new_bytes;
      fmt::print("{}: {} bytes in {} pieces, {} of them new ({:.1f} % was there)\n", argv[i], bytes,
                 pieces.size(), new_bytes,
                 100 - 100 * static_cast<double>(new_bytes) / static_cast<double>(bytes));
    }
  } catch (const core::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  fmt::print("together: {} bytes, stored {}\n", total_bytes, stored_bytes);
  return 0;
}
