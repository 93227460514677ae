#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/digest.h"

namespace weft::storage {

// A part of a file, named by its bytes. A file is the concatenation of its pieces, so files that
// share bytes share pieces, wherever in the file those bytes stand.
struct Piece {
  core::Digest digest;
  std::uint64_t size_bytes = 0;

  bool operator==(const Piece&) const = default;
};

// No piece is smaller than kPieceLeastBytes, the last one of a file and those before a boundary
// apart, and none is larger than kPieceLimitBytes.
inline constexpr std::size_t kPieceLeastBytes = std::size_t{16} << 10;
inline constexpr std::size_t kPieceUsualBytes = std::size_t{64} << 10;
inline constexpr std::size_t kPieceLimitBytes = std::size_t{256} << 10;
// What lies between two boundaries stands alone when it has so many bytes.
inline constexpr std::size_t kPieceAloneBytes = std::size_t{2} << 10;

// Cuts a stream of bytes where its contents say so, after FastCDC (Xia et al. 2016): a rolling hash
// of the last 64 bytes decides, with a stricter mask before the usual size and a looser one after
// it. The same bytes with the same boundaries give the same pieces, whatever calls they come in.
class PieceCutter {
 public:
  // Called with each piece and its bytes, in order.
  using Sink = std::function<void(const Piece& piece, std::string_view bytes)>;

  // A piece also ends at each of `boundaries` (offsets in the stream, ascending) that is
  // kPieceAloneBytes or more behind the last cut.
  PieceCutter(std::vector<std::uint64_t> boundaries, Sink sink);

  void add(std::string_view bytes);
  // Once, after the last byte.
  void finish();

 private:
  [[nodiscard]] std::size_t next_cut() const;
  void emit(std::size_t size_bytes);

  std::vector<std::uint64_t> boundaries_;
  Sink sink_;
  std::string kept_;        // bytes behind the last cut
  std::uint64_t cut_ = 0;   // where kept_ begins in the stream
  std::size_t passed_ = 0;  // boundaries that are no longer ahead
};

// Where pieces of a fabric database should end: around the stored chunks of its datasets, which
// hold no addresses, and so are the same in files whose contents are the same. Nothing for a file
// that is no fabric database.
[[nodiscard]] std::vector<std::uint64_t> piece_boundaries(const std::filesystem::path& database);

// Cuts a file at its piece_boundaries, in bounded memory. `sink` may be empty. Throws
// core::Error(kNotFound) when the file cannot be read.
std::vector<Piece> cut_file(const std::filesystem::path& path, const PieceCutter::Sink& sink);

// A list of pieces as bytes, and back: 32 bytes of digest, 4 of size (little-endian) for each.
[[nodiscard]] std::string encode_pieces(std::span<const Piece> pieces);
// Throws core::Error(kDataLoss) when `bytes` are none.
[[nodiscard]] std::vector<Piece> decode_pieces(std::string_view bytes);

}  // namespace weft::storage
