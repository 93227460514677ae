#include <cstdlib>
#include <string>

#include "core/error.h"
#include "fabric/description.h"
#include "fuzz/target.h"

// A description that somebody wrote: protobuf text, or JSON when the first byte is odd. What is
// taken is canonical, and so is taken again when it comes over the wire.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::string_view text = weft::fuzz::text_of(data + 1, size - 1);
  const char* name = data[0] % 2 == 0 ? "fuzz.textproto" : "fuzz.json";
  weft::v1::FabricDescription description;
  try {
    description = weft::fabric::parse_description(text, name, "/absent/folder");
  } catch (const weft::core::Error&) {
    return 0;
  }
  weft::fabric::check_description(description);
  return 0;
}
