#pragma once

#include <cstdint>
#include <string>

#include "core/parallel.h"
#include "fabric/relax.h"
#include "fabric/tile.h"
#include "fabric/untangle.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// Builds the fibres of one periodic tile from a canonical description (see description.h) or its
// geometry part. The same description gives the same bytes. Throws core::Error(kInvalidArgument)
// when no such cloth can be built (yarns that cannot be packed) and kResourceExhausted when the
// tile would exceed kTileLimitBytes or one repeat kRelaxedNodeLimit.
// On any number of threads the same.
struct BuildOptions {
  unsigned most_threads = core::kAllCores;
  // When given, told how the yarns were relaxed and how their fibres were moved apart (explicit
  // fibres stay as they are).
  RelaxReport* relaxed = nullptr;
  UntangleReport* untangled = nullptr;
};
[[nodiscard]] Tile build_tile(const v1::FabricDescription& description,
                              const BuildOptions& options = {});

// What a tile will need, computed from the description alone, before any of it is built.
struct TileEstimate {
  std::uint32_t ends = 0;
  std::uint32_t picks = 0;
  std::uint64_t fibres = 0;
  std::uint64_t segments = 0;
  std::uint64_t memory_bytes = 0;
};
[[nodiscard]] TileEstimate estimate_tile(const v1::FabricDescription& description);

// Nodes of the centre curves of one repeat: 16 for every crossing of a weave. Relaxing so many
// takes minutes.
inline constexpr std::uint64_t kRelaxedNodeLimit = 400000;

inline constexpr std::uint64_t kTileLimitBytes = std::uint64_t{2} << 30;

}  // namespace weft::fabric
