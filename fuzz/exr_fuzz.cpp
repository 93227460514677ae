#include "fuzz/target.h"
#include "render/files/exr_parser.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  weft::fuzz::run_apart([&] {
    static_cast<void>(
        weft::render::parse_exr(weft::fuzz::text_of(data, size), "fuzz.exr", "single"));
    static_cast<void>(weft::render::parse_exr(weft::fuzz::text_of(data, size), "fuzz.exr", ""));
  });
  return 0;
}
