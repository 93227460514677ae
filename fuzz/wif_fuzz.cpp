#include "core/error.h"
#include "fabric/read_draft.h"
#include "fabric/wif_import.h"
#include "fabric/wif_write.h"
#include "fuzz/target.h"

// A draft, of the format that its bytes look like; it as WIF; and the description made of it.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const weft::fabric::WifDraft draft =
        weft::fabric::read_draft(weft::fuzz::text_of(data, size), "fuzz");
    weft::fabric::ImportOptions options;
    options.name = "fuzz";
    options.draft_name = "fuzz";
    options.wif_reference = "fuzz.wif";
    static_cast<void>(weft::fabric::import_draft(draft, options));
    if (draft.up.size() <= 4096) {
      static_cast<void>(weft::fabric::read_wif(weft::fabric::write_wif(draft), "written.wif"));
    }
  } catch (const weft::core::Error&) {
  }
  return 0;
}
