#include "cli/fabric_shelf.h"

#include <filesystem>
#include <utility>

#include "cli/fabric_reference.h"

namespace weft::cli {

FabricShelf::FabricShelf(std::string main_reference, security::Endpoint coordinator,
                         render::Fabric::Wanted wanted, std::function<bool()> should_stop)
    : main_reference_(std::move(main_reference)),
      coordinator_(std::move(coordinator)),
      wanted_(wanted),
      should_stop_(std::move(should_stop)) {}

const render::LoadedFabric& FabricShelf::take(const std::string& reference) {
  const std::string& named = reference.empty() ? main_reference_ : reference;
  const auto found = fabrics_.find(named);
  if (found != fabrics_.end()) {
    return found->second;
  }
  const std::filesystem::path path =
      render::is_description(named) ? named
                                    : resolve_fabric(named, coordinator_, should_stop_).string();
  return fabrics_.emplace(named, render::load_fabric(path, wanted_)).first->second;
}

FabricIdentities FabricShelf::identities() const {
  FabricIdentities identities;
  for (const auto& [reference, loaded] : fabrics_) {
    identities[reference] = {loaded.name, loaded.content_digest};
  }
  return identities;
}

}  // namespace weft::cli
