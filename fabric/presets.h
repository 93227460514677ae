#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// A text of examples/ that the binary carries within itself. Made at build time.
struct EmbeddedText {
  std::string_view kind;  // "fabric", "yarn" or "material"
  std::string_view name;  // the file's, without its ending
  std::string_view text;  // protobuf text of a FabricDescription, Yarn or Material
};

// In alphabetical order of kind and name.
[[nodiscard]] std::span<const EmbeddedText> embedded_texts();

// The names of one kind, and the text of one; nullopt when there is none of that name.
[[nodiscard]] std::vector<std::string> embedded_names(std::string_view kind);
[[nodiscard]] std::optional<std::string_view> embedded_text(std::string_view kind,
                                                            std::string_view name);

// A yarn or material preset as its file says; nullopt when there is none of that name.
[[nodiscard]] std::optional<v1::Yarn> yarn_preset(std::string_view name);
[[nodiscard]] std::optional<v1::Material> material_preset(std::string_view name);

// Fills what `yarn` leaves out from a preset, which is first scaled to yarn.yarn_radius_mm where
// that is set. The same for a material; a colour is taken whole or not at all.
void fill_from_preset(v1::Yarn& yarn, const v1::Yarn& preset);
void fill_from_preset(v1::Material& material, const v1::Material& preset);

}  // namespace weft::fabric
