#pragma once

#include <filesystem>
#include <string>

#include "client/coordinator.h"
#include "core/digest.h"

namespace weft::client {

// A colourway that is to become a version of a fabric.
struct ColourwayOffer {
  std::filesystem::path file;
  core::Digest content_digest;
  std::string fabric;
  std::string base;     // "silk@3", from which its light was carried over
  std::string comment;  // at most 1024 bytes
};

// Sends a colourway to the coordinator, again while it is not known whether it arrived, and returns
// the version that it became. Throws core::Error: kFailedPrecondition when the coordinator is older
// than colourways that are published, and what cluster.proto states for PublishColourway.
[[nodiscard]] v1::Version publish_colourway(Coordinator& coordinator, const ColourwayOffer& offer);

}  // namespace weft::client
