#include <cstdio>

#include "core/sandbox_child.h"
#include "storage/database_parser.h"

int main(int argc, char** argv) {
  namespace core = weft::core;
  const int code = core::serve_sandbox(
      argc, argv, {{weft::storage::kDatabaseRequest, weft::storage::database_handler()}});
  std::fputs(
      "weft-open reads files for weft's other programs, which start it; it is of no use alone\n",
      stderr);
  return code;
}
