#include "client/piece_index.h"

#include "core/error.h"
#include "storage/fabric_database.h"

namespace weft::client {

void PieceIndex::add_piece(const std::filesystem::path& path, std::uint64_t offset,
                           const storage::Piece& piece) {
  places_.emplace(piece.digest, Place{path, offset});
}

void PieceIndex::add_file(const std::filesystem::path& path,
                          const std::vector<storage::Piece>& pieces) {
  std::uint64_t offset = 0;
  for (const storage::Piece& piece : pieces) {
    add_piece(path, offset, piece);
    offset += piece.size_bytes;
  }
}

void PieceIndex::add_database(const std::filesystem::path& path) {
  try {
    (void)storage::content_digest(path);
    add_file(path, storage::cut_file(path, {}));
  } catch (const core::Error&) {
    return;
  }
}

std::optional<std::string> PieceIndex::take(const storage::Piece& piece) {
  const auto place = places_.find(piece.digest);
  if (place == places_.end()) {
    return std::nullopt;
  }
  if (!open_file_.is_open() || open_path_ != place->second.file) {
    open_path_ = place->second.file;
    open_file_ = std::ifstream(open_path_, std::ios::binary);
  }
  open_file_.clear();
  open_file_.seekg(static_cast<std::streamoff>(place->second.offset));
  std::string bytes(piece.size_bytes, '\0');
  if (open_file_.read(bytes.data(), static_cast<std::streamsize>(bytes.size())) &&
      core::digest_of(bytes) == piece.digest) {
    return bytes;
  }
  places_.erase(place);
  return std::nullopt;
}

}  // namespace weft::client
