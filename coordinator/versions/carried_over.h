#pragma once

#include <string>

namespace weft::coordinator {

// From what the light of a colourway was carried over, and how far it was off when it was made: the
// dataset /provenance/carried_over.
struct CarriedOver {
  std::string base;         // "silk@3", or the name of a file
  std::string base_digest;  // of its contents, 64 hexadecimal digits
  // As of the traced light and matrices (docs/colourways.md).
  double light_error = 0;
  double light_error_noise = 0;
  double matrix_error = 0;
};

[[nodiscard]] std::string carried_over_json(const CarriedOver& carried);
// Reads what may come from a stranger: what is missing or of another kind is empty or 0.
[[nodiscard]] CarriedOver parse_carried_over(const std::string& json);

}  // namespace weft::coordinator
