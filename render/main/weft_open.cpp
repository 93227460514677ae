#include <cstdio>

#include "core/sandbox_child.h"
#include "render/files/exr_parser.h"
#include "render/files/gltf_parser.h"
#include "render/files/obj_parser.h"
#include "render/files/png_parser.h"
#include "storage/database_parser.h"

int main(int argc, char** argv) {
  namespace core = weft::core;
  const int code =
      core::serve_sandbox(argc, argv,
                          {{weft::storage::kDatabaseRequest, weft::storage::database_handler()},
                           {weft::render::kExrRequest, weft::render::exr_handler()},
                           {weft::render::kGltfRequest, weft::render::gltf_handler()},
                           {weft::render::kObjRequest, weft::render::obj_handler()},
                           {weft::render::kPngRequest, weft::render::png_handler()}});
  std::fputs(
      "weft-open reads files for weft's other programs, which start it; it is of no use alone\n",
      stderr);
  return code;
}
