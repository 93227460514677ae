#include <string>

#include "fuzz/target.h"
#include "render/files/obj_parser.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  weft::fuzz::run_apart([&] {
    static_cast<void>(
        weft::render::parse_obj(std::string(weft::fuzz::text_of(data, size)), "fuzz.obj"));
  });
  return 0;
}
