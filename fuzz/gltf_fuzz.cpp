#include <string>

#include "fuzz/target.h"
#include "render/files/gltf_parser.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  weft::fuzz::run_apart([&] {
    static_cast<void>(
        weft::render::parse_gltf(std::string(weft::fuzz::text_of(data, size)), "fuzz.gltf"));
  });
  return 0;
}
