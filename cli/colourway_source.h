#pragma once

#include <optional>
#include <string>

#include "core/digest.h"
#include "proto/weft/v1/fabric.pb.h"
#include "security/endpoint.h"
#include "storage/recolouring.h"

namespace weft::cli {

// A fabric that colourways are made of.
struct ColourwaySource {
  std::string reference;      // "silk@3", or the file's name
  bool is_published = false;  // else it is a file
  core::Digest digest;        // of its contents
  storage::RecolourableDatabase contents;
  v1::FabricDescription description;  // that it was made from, checked
};

// Reads the fabric that `reference` names: a database's file, or a published version. Throws
// core::Error.
[[nodiscard]] ColourwaySource open_colourway_source(const std::string& reference,
                                                    const security::Endpoint& coordinator);

// The fabric from which the light of `source` was carried over; nothing when it was traced. Throws
// core::Error(kFailedPrecondition) when it cannot be had.
[[nodiscard]] std::optional<ColourwaySource> base_of(const ColourwaySource& source,
                                                     const security::Endpoint& coordinator);

}  // namespace weft::cli
