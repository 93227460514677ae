#include "core/error.h"
#include "fabric/bcc.h"
#include "fabric/knit_pattern.h"
#include "fuzz/target.h"

// Curves, and the pattern of yarns that they make.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace fabric = weft::fabric;
  try {
    const auto curves = fabric::read_bcc(weft::fuzz::text_of(data, size), "fuzz.bcc");
    const fabric::CurveTiling tiling{{2, 3}, 1, 0.1};
    static_cast<void>(fabric::explicit_fibres(curves, tiling, "fibre"));
    static_cast<void>(fabric::parse_pyp(fabric::pattern_text(curves, tiling, "fuzz.bcc")));
  } catch (const weft::core::Error&) {
  }
  return 0;
}
