#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/digest.h"

namespace weft::cli {

struct ImportedDatabase {
  std::filesystem::path path;
  core::Digest digest;
  std::uint64_t size_bytes = 0;
};

// Takes in a database that came some other way than from a coordinator: copies it, has the copy
// read and checked whole in the sandbox (storage::verify_database), and gives it the name `output`,
// or, when that is empty, its place among fetched fabrics, where its digest is its name. Nothing is
// left behind of a file that is refused. Throws core::Error.
[[nodiscard]] ImportedDatabase import_database(const std::filesystem::path& from,
                                               const std::string& output);

}  // namespace weft::cli
