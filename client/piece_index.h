#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/digest.h"
#include "storage/pieces.h"

namespace weft::client {

// Where pieces of versions lie in files that are here already. What it knows may be out of date: a
// piece is checked against its digest when it is read. One thread.
class PieceIndex {
 public:
  // A file that is made of these pieces, in this order.
  void add_file(const std::filesystem::path& path, const std::vector<storage::Piece>& pieces);
  // The same for a file of which nobody knows the pieces; nothing happens when it is no fabric
  // database.
  void add_database(const std::filesystem::path& path);
  void add_piece(const std::filesystem::path& path, std::uint64_t offset,
                 const storage::Piece& piece);

  [[nodiscard]] bool has(const core::Digest& digest) const { return places_.contains(digest); }
  // The piece's bytes; nothing, and it is forgotten, when they are not there any more.
  [[nodiscard]] std::optional<std::string> take(const storage::Piece& piece);

 private:
  struct Place {
    std::filesystem::path file;
    std::uint64_t offset = 0;
  };
  std::map<core::Digest, Place> places_;
  std::filesystem::path open_path_;
  std::ifstream open_file_;  // the one that was read last
};

}  // namespace weft::client
