#include "storage/pieces.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "storage/database_summary.h"

namespace weft::storage {

namespace {

constexpr std::size_t kDigestBytes = 32;
constexpr std::size_t kEntryBytes = kDigestBytes + 4;
constexpr std::size_t kReadBytes = std::size_t{1} << 20;

// One number for each byte (splitmix64 of its value: Steele et al. 2014). They are part of what
// makes equal files equal pieces and must never change.
constexpr std::array<std::uint64_t, 256> gear_table() {
  std::array<std::uint64_t, 256> table{};
  std::uint64_t state = 0x776566742d312e30;
  for (std::uint64_t& entry : table) {
    state += 0x9e3779b97f4a7c15;
    std::uint64_t z = state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    entry = z ^ (z >> 31);
  }
  return table;
}
constexpr std::array<std::uint64_t, 256> kGear = gear_table();

// The high bits of the hash depend on the most bytes. 2^-18 before the usual size, 2^-14 after it:
// two bits more and less than its logarithm, as the paper's normalisation 2.
constexpr std::uint64_t kStrictMask = ((std::uint64_t{1} << 18) - 1) << 46;
constexpr std::uint64_t kLooseMask = ((std::uint64_t{1} << 14) - 1) << 50;

// Where the contents end the piece that begins with `bytes`; its size when they do not.
std::size_t content_cut(std::string_view bytes) {
  const std::size_t end = std::min(bytes.size(), kPieceLimitBytes);
  std::uint64_t hash = 0;
  // The hash is of 64 bytes at the first place that may be a cut, too.
  for (std::size_t i = kPieceLeastBytes - 64; i < end; ++i) {
    hash = (hash << 1) + kGear[static_cast<unsigned char>(bytes[i])];
    const std::uint64_t mask = i < kPieceUsualBytes ? kStrictMask : kLooseMask;
    if (i >= kPieceLeastBytes && (hash & mask) == 0) {
      return i + 1;
    }
  }
  return end;
}

}  // namespace

PieceCutter::PieceCutter(std::vector<std::uint64_t> boundaries, Sink sink)
    : boundaries_(std::move(boundaries)), sink_(std::move(sink)) {
  CHECK(std::is_sorted(boundaries_.begin(), boundaries_.end()));
}

std::size_t PieceCutter::next_cut() const {
  const std::size_t cut = content_cut(kept_);
  for (std::size_t i = passed_; i < boundaries_.size() && boundaries_[i] < cut_ + cut; ++i) {
    if (boundaries_[i] >= cut_ + kPieceAloneBytes) {
      return static_cast<std::size_t>(boundaries_[i] - cut_);
    }
  }
  return cut;
}

void PieceCutter::emit(std::size_t size_bytes) {
  const std::string_view bytes = std::string_view(kept_).substr(0, size_bytes);
  sink_({core::digest_of(bytes), size_bytes}, bytes);
  kept_.erase(0, size_bytes);
  cut_ += size_bytes;
  while (passed_ < boundaries_.size() && boundaries_[passed_] <= cut_) {
    ++passed_;
  }
}

void PieceCutter::add(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t taken = std::min(bytes.size(), kPieceLimitBytes - kept_.size());
    kept_.append(bytes.substr(0, taken));
    bytes.remove_prefix(taken);
    if (kept_.size() == kPieceLimitBytes) {
      emit(next_cut());
    }
  }
}

void PieceCutter::finish() {
  while (!kept_.empty()) {
    emit(next_cut());
  }
}

std::vector<std::uint64_t> piece_boundaries(const std::filesystem::path& database) {
  std::vector<std::uint64_t> boundaries;
  try {
    for (const StoredChunk& chunk : stored_chunks(database)) {
      if (chunk.size_bytes >= kPieceAloneBytes) {
        boundaries.push_back(chunk.offset);
        boundaries.push_back(chunk.offset + chunk.size_bytes);
      }
    }
  } catch (const core::Error& error) {
    if (error.code() == core::Code::kDataLoss || error.code() == core::Code::kFailedPrecondition ||
        error.code() == core::Code::kNotFound) {
      return {};
    }
    throw;
  }
  std::sort(boundaries.begin(), boundaries.end());
  return boundaries;
}

std::vector<Piece> cut_file(const std::filesystem::path& path, const PieceCutter::Sink& sink) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw core::Error(core::Code::kNotFound, "cannot read " + path.string());
  }
  std::vector<Piece> pieces;
  PieceCutter cutter(piece_boundaries(path), [&](const Piece& piece, std::string_view bytes) {
    pieces.push_back(piece);
    if (sink) {
      sink(piece, bytes);
    }
  });
  std::string buffer(kReadBytes, '\0');
  while (file) {
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    cutter.add(std::string_view(buffer).substr(0, static_cast<std::size_t>(file.gcount())));
  }
  if (file.bad()) {
    throw core::Error(core::Code::kUnavailable, "cannot read " + path.string());
  }
  cutter.finish();
  return pieces;
}

std::string encode_pieces(std::span<const Piece> pieces) {
  std::string bytes;
  bytes.reserve(pieces.size() * kEntryBytes);
  for (const Piece& piece : pieces) {
    bytes += piece.digest.binary();
    for (unsigned shift = 0; shift < 32; shift += 8) {
      bytes += static_cast<char>((piece.size_bytes >> shift) & 0xff);
    }
  }
  return bytes;
}

std::vector<Piece> decode_pieces(std::string_view bytes) {
  if (bytes.size() % kEntryBytes != 0) {
    throw core::Error(core::Code::kDataLoss, "a list of pieces is damaged");
  }
  std::vector<Piece> pieces;
  for (; !bytes.empty(); bytes.remove_prefix(kEntryBytes)) {
    Piece piece{*core::Digest::from_binary(bytes.substr(0, kDigestBytes)), 0};
    for (std::size_t i = 0; i < 4; ++i) {
      const auto byte = static_cast<unsigned char>(bytes[kDigestBytes + i]);
      piece.size_bytes |= std::uint64_t{byte} << (8 * i);
    }
    if (piece.size_bytes == 0 || piece.size_bytes > kPieceLimitBytes) {
      throw core::Error(core::Code::kDataLoss, "a list of pieces is damaged");
    }
    pieces.push_back(piece);
  }
  return pieces;
}

}  // namespace weft::storage
