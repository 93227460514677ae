#pragma once

#include <string>

#include "tests/cli_programs.h"

namespace weft::cli {

// As write_description, of one material: the tables of a second one take a second wherever the
// fabric is loaded.
inline std::string write_one_material(const TestFolder& folder, const std::string& paths_per_cell) {
  const std::string path = write_description(folder, paths_per_cell);
  std::string text = core::read_file(path);
  const std::size_t indigo = text.find("materials {");
  text.erase(indigo, text.find("materials {", indigo + 1) - indigo);
  text.replace(text.find("indigo"), 6, "straw");
  core::write_file_atomically(path, text);
  return path;
}

}  // namespace weft::cli
