#pragma once

#include <string>

#include "core/digest.h"
#include "storage/recolouring.h"

namespace weft::coordinator {

// A version that colourways are made of.
struct ColourwayBase {
  std::string reference;  // "silk@3"
  core::Digest digest;    // of its contents
  storage::RecolourableDatabase contents;
};

// Throws core::Error(kInvalidArgument), saying where it differs, unless `colourway` is the base in
// other colours, by the name `fabric`: it says that its light was carried over from the base; its
// description is the base's but for the name and the colours of fibres, and for yarns of one
// material that have one each now; so are its fibres, its cells, its visibility and its provenance.
// Whether its light is right is not looked at.
void check_colourway(const storage::RecolourableDatabase& colourway, const std::string& fabric,
                     const ColourwayBase& base);

}  // namespace weft::coordinator
