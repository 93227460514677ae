#include "core/error.h"
#include "fabric/wif.h"
#include "fabric/wif_import.h"
#include "fuzz/target.h"

// A draft, and the description that is made of it.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const weft::fabric::WifDraft draft =
        weft::fabric::read_wif(weft::fuzz::text_of(data, size), "fuzz.wif");
    weft::fabric::ImportOptions options;
    options.name = "fuzz";
    options.wif_reference = "fuzz.wif";
    static_cast<void>(weft::fabric::import_draft(draft, options));
  } catch (const weft::core::Error&) {
  }
  return 0;
}
