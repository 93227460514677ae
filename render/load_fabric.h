#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "proto/weft/v1/fabric.pb.h"
#include "render/fabric.h"

namespace weft::render {

// A fabric from a file, ready for tracing.
struct LoadedFabric {
  std::string name;                      // of its description; empty when the database names none
  std::string content_digest;            // hexadecimal, of the database; empty for a description
  std::shared_ptr<const Fabric> fabric;  // shared: by the pieces of cloth of a scene
};

// Whether the file's name is that of a description (.textproto, .txtpb, .json), not a database.
[[nodiscard]] bool is_description(const std::filesystem::path& path);

// Reads a fabric database, or builds the fibres of a description: enough for the path integrator,
// which needs nothing precomputed. Throws core::Error.
[[nodiscard]] LoadedFabric load_fabric(const std::filesystem::path& path, Fabric::Wanted wanted);

// The fabric of a canonical description.
[[nodiscard]] std::unique_ptr<Fabric> build_fabric(const v1::FabricDescription& description);

}  // namespace weft::render
