#pragma once

#include <functional>
#include <map>
#include <string>

#include "cli/picture_metadata.h"
#include "render/load_fabric.h"
#include "security/endpoint.h"

namespace weft::cli {

// The fabrics of one scene, each loaded once.
class FabricShelf {
 public:
  // `main_reference` is what an empty reference means; published versions are fetched from
  // `coordinator`, until `should_stop` says so.
  FabricShelf(std::string main_reference, security::Endpoint coordinator,
              render::Fabric::Wanted wanted, std::function<bool()> should_stop);

  // Loads what `reference` (a database's or description's path, or a published version) names.
  // Throws core::Error.
  const render::LoadedFabric& take(const std::string& reference);

  // All that were taken.
  [[nodiscard]] FabricIdentities identities() const;

 private:
  std::string main_reference_;
  security::Endpoint coordinator_;
  render::Fabric::Wanted wanted_;
  std::function<bool()> should_stop_;
  std::map<std::string, render::LoadedFabric> fabrics_;
};

}  // namespace weft::cli
