#pragma once

#include <string>

namespace weft::cli {

// How `weft import` takes curves (BCC).
struct CurveImport {
  std::string curves;  // the file
  std::string out;
  std::string name;    // of the fabric; empty: the file's
  std::string period;  // "X,Y" millimetres
  std::string as = "yarns";
  double mm_per_unit = 1;
  double radius_mm = 0.1;
  bool json = false;
};

// Whether the file's name says that it holds curves.
[[nodiscard]] bool holds_curves(const std::string& name);

// Writes a description of the cloth that the curves make when they are repeated: of yarns, beside a
// pattern (.pyp) that it names, or of fibres. Throws core::Error(kInvalidArgument) when a yarn ends
// within the cloth, CLI::ValidationError when the period is missing or is none.
void import_curves(const CurveImport& wanted);

}  // namespace weft::cli
