#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "security/endpoint.h"

namespace weft::cli {

// A published fabric: a name, and a version number or a tag, or the latest.
struct FabricReference {
  std::string name;                      // [a-z0-9][a-z0-9_-]{0,63}
  std::optional<std::uint64_t> version;  // from 1; nothing: the latest, or that of the tag
  std::string tag = {};                  // [a-z0-9][a-z0-9_.-]{0,63}; empty: none

  bool operator==(const FabricReference&) const = default;
};

// Reads "silk", "silk@latest", "silk@3" or "silk:approved"; nothing when `text` is none of them.
[[nodiscard]] std::optional<FabricReference> parse_reference(std::string_view text);

// What is wrong with `text` as a published version's name; empty when it is one.
[[nodiscard]] std::string mistake_in_reference(const std::string& text);

// The file that `reference` means: a path to a database, or a published version (parse_reference)
// that is fetched from the coordinator at `coordinator` (host:port) into the local cache, unless it
// is there already. What reads as a published version is never taken for a path; write ./silk for a
// file of such a name. Throws core::Error: kNotFound when there is no such file, fabric or version,
// kUnavailable when the coordinator does not answer, kCancelled when `should_stop`, which may be
// empty, said so while it was fetched; what came is kept.
[[nodiscard]] std::filesystem::path resolve_fabric(const std::string& reference,
                                                   const security::Endpoint& coordinator,
                                                   const std::function<bool()>& should_stop = {});

// Where fetched databases are kept: $XDG_CACHE_HOME/weft/fabrics, else ~/.cache/weft/fabrics.
[[nodiscard]] std::filesystem::path fabric_cache_folder();

// Where fits of environment pictures are kept, beside the former; empty when neither is set.
[[nodiscard]] std::filesystem::path environment_cache_folder();

}  // namespace weft::cli
