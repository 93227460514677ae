#include <algorithm>
#include <string>

#include "core/digest.h"
#include "core/error.h"
#include "fuzz/target.h"
#include "storage/database_parser.h"
#include "storage/user_block.h"

namespace {

void read(const std::string& file) {
  weft::fuzz::run_apart(
      [&] { static_cast<void>(weft::storage::parse_database_here(file, "fuzz.h5")); });
}

}  // namespace

// A database file as it came; and when its first bytes are not right, once more under a right
// digest, so that HDF5 and our reader see it.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace storage = weft::storage;
  std::string file(weft::fuzz::text_of(data, size));
  try {
    static_cast<void>(storage::parse_user_block(file.substr(0, storage::kUserBlockBytes),
                                                file.size(), "fuzz.h5"));
  } catch (const weft::core::Error&) {
  }
  file.resize(std::max<std::size_t>(file.size(), storage::kUserBlockBytes));
  storage::UserBlock block;
  block.file_bytes = file.size();
  block.digest = weft::core::digest_of(std::string_view(file).substr(storage::kUserBlockBytes));
  file.replace(0, storage::kUserBlockBytes, storage::encode_user_block(block));
  read(file);
  return 0;
}
