#include "fuzz/target.h"
#include "render/files/png_parser.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  weft::fuzz::run_apart([&] {
    static_cast<void>(
        weft::render::parse_plain_png(weft::fuzz::text_of(data, size), "fuzz.png", 4096));
  });
  return 0;
}
