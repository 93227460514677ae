#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "core/digest.h"
#include "core/sandbox_child.h"
#include "storage/fabric_database.h"

namespace weft::storage {

// What weft-open is asked for: the kind of file, and how much of it.
inline constexpr const char* kDatabaseRequest = "database";
inline constexpr const char* kArraysRequest = "arrays";
inline constexpr const char* kShapesRequest = "shapes";

// The sandbox's half: parses with HDF5 and hands the datasets back plainly.
[[nodiscard]] core::SandboxHandler database_handler();

// Reads and checks a database in this very process: for what this process has just written itself,
// and for those who test the parser. `file` is a whole file; its digest is checked. Throws as
// read_database; `name` stands for the file in messages.
struct ParsedDatabase {
  core::Digest digest;
  FabricDatabase database;
};
[[nodiscard]] ParsedDatabase parse_database_here(std::string_view file, const std::string& name);

}  // namespace weft::storage
