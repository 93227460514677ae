#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "cli/carry_check.h"
#include "cli/make_colourway.h"

namespace weft::cli {

// What `weft recolor` made, as far as it was.
struct Recolored {
  ColourFit fit;
  std::optional<CarryError> error;  // of light that was carried over
  bool is_exact = false;            // it was traced
  std::string output;               // the file that was written; empty: none
  std::string version;              // that was published; empty: none
  std::string digest;               // of the contents; empty in a dry run
};

// What the command prints: with --json (docs/schemas/recolor.json), and without. `base` is from
// what the light was carried over.
[[nodiscard]] nlohmann::ordered_json to_json(const Recolored& made, const ColourwayRequest& request,
                                             const std::string& base, double seconds);
void print_text(const Recolored& made, const ColourwayRequest& request, const std::string& base,
                double seconds);

}  // namespace weft::cli
