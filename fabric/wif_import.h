#pragma once

#include <string>
#include <vector>

#include "fabric/wif.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

struct ImportOptions {
  std::string name;           // of the fabric; is_name
  std::string draft_name;     // what the draft is called in the description's first comment
  std::string wif_reference;  // path of the draft as WIF, as the description will name it
  v1::Crop crop;
  double fibre_share = 1;
};

// A description as a text that a person goes on with, and what was decided on the way to it.
struct ImportedDraft {
  std::string text;                // protobuf text of a FabricDescription, with comments
  std::vector<std::string> notes;  // the draft's own, then those of the import
  bool refers = false;             // to options.wif_reference, for its repeat is too large
};

// Describes the cloth of a draft: its weave inline where it repeats within kMaxInlineThreads, else
// by reference; sett and yarn radius from its spacing and thickness as far as they make a cloth;
// one yarn and one material per colour. Throws core::Error(kInvalidArgument) when the crop lies
// outside.
[[nodiscard]] ImportedDraft import_draft(const WifDraft& draft, const ImportOptions& options);

inline constexpr std::uint32_t kMaxInlineThreads = 64;

// A fabric's name from a file's: its stem in small letters, everything else as "_".
[[nodiscard]] std::string name_from_file(const std::string& stem);

}  // namespace weft::fabric
