#include "cli/colourway_source.h"

#include <filesystem>

#include <google/protobuf/util/json_util.h>

#include "cli/client.h"
#include "cli/fabric_reference.h"
#include "client/fetch_version.h"
#include "coordinator/versions/carried_over.h"
#include "core/error.h"
#include "fabric/description.h"

namespace weft::cli {

namespace {

// The text came with the file: it may name no other one, so that it is not read as people's
// descriptions are.
v1::FabricDescription description_in(const storage::FabricDatabase& database,
                                     const std::string& name) {
  v1::FabricDescription description;
  std::string what;
  if (!google::protobuf::util::JsonStringToMessage(database.description_json, &description).ok()) {
    what = "it is no description of this weft";
  } else if (description.weave().has_wif_file() || description.yarn_curves().has_pyp_file()) {
    what = "it names a file";
  } else {
    try {
      fabric::check_description(description);
    } catch (const core::Error& error) {
      what = error.what();
    }
  }
  if (!what.empty()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      name + ": the description in it cannot be used: " + what +
                          "; make the fabric again with 'weft run'");
  }
  return description;
}

}  // namespace

ColourwaySource open_colourway_source(const std::string& reference,
                                      const security::Endpoint& coordinator) {
  ColourwaySource source;
  source.reference = reference;
  source.is_published = parse_reference(reference).has_value();
  if (source.is_published) {
    Client connection(coordinator);
    source.reference = client::reference_text(client::find_version(connection, reference));
  }
  const std::filesystem::path path = resolve_fabric(source.reference, coordinator);
  source.contents = storage::read_recolourable(path);
  source.digest = storage::content_digest(path);
  source.description = description_in(source.contents.database, source.reference);
  return source;
}

std::optional<ColourwaySource> base_of(const ColourwaySource& source,
                                       const security::Endpoint& coordinator) {
  const std::string& text = source.contents.recolouring.carried_over_json;
  if (text.empty()) {
    return std::nullopt;
  }
  const coordinator::CarriedOver carried = coordinator::parse_carried_over(text);
  const std::string how = source.reference + " is a colourway itself, of " + carried.base;
  if (!parse_reference(carried.base)) {
    throw core::Error(core::Code::kFailedPrecondition,
                      how + "; colour that file instead, which has the paths' light");
  }
  ColourwaySource base = open_colourway_source(carried.base, coordinator);
  if (base.digest.hex() != carried.base_digest) {
    throw core::Error(core::Code::kFailedPrecondition,
                      how +
                          ", and what has this name now is another fabric; colour the fabric "
                          "instead that has the content digest " +
                          carried.base_digest.substr(0, 12));
  }
  return base;
}

}  // namespace weft::cli
