#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "client/coordinator.h"
#include "client/piece_index.h"
#include "core/digest.h"

namespace weft::client {

// "silk@3".
[[nodiscard]] std::string reference_text(const v1::Version& version);

// The version that `reference` (silk, silk@3, silk@latest, silk:approved) means now. Throws
// core::Error(kInvalidArgument, kNotFound or kUnavailable).
[[nodiscard]] v1::Version find_version(Coordinator& coordinator, const std::string& reference);

// What the version's file must hold. Throws core::Error(kDataLoss) when the answer has no digest.
[[nodiscard]] core::Digest version_digest(const v1::Version& version);

// Called with bytes that are here and bytes in all. What it throws ends the fetch; what came is
// kept.
using FetchReport = std::function<void(std::uint64_t, std::uint64_t)>;

struct FetchOutcome {
  bool was_there = false;              // nothing had to be fetched
  std::uint64_t bytes_kept = 0;        // of an earlier fetch that was broken off
  std::uint64_t bytes_reused = 0;      // of pieces that other files here had
  std::uint64_t bytes_fetched = 0;     // over the wire
  std::vector<storage::Piece> pieces;  // of the file; empty when nobody asked for them
};

// Brings the version's file to `path`: written beside as PATH.DIGEST.part, gone on with when an
// earlier fetch was broken off, checked against its digest, renamed. Only pieces that neither
// `here` nor an older database at `path` has are fetched. A file at `path` that is this very
// version already is kept. `report` may be empty. Throws core::Error: kUnavailable when the
// coordinator stays away (what came is kept), kDataLoss when the bytes are not the version's.
FetchOutcome fetch_version(Coordinator& coordinator, const v1::Version& version,
                           const std::filesystem::path& path, const FetchReport& report,
                           PieceIndex here = {});

}  // namespace weft::client
