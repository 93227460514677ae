#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/digest.h"

namespace weft::storage {

// The first 512 bytes of a fabric database: text that says what the file is, and the digest of
// everything after it, so that a file verifies itself:
//   weft fabric database
//   schema 1
//   bytes <size of the whole file>
//   sha256 <64 hexadecimal digits>
// padded with zero bytes. `tail -c +513 FILE | sha256sum` gives the same digest.
inline constexpr std::uint64_t kUserBlockBytes = 512;
inline constexpr std::uint32_t kDatabaseSchema = 1;

struct UserBlock {
  std::uint32_t schema = kDatabaseSchema;
  std::uint64_t file_bytes = 0;
  core::Digest digest;
};

// Exactly kUserBlockBytes bytes.
[[nodiscard]] std::string encode_user_block(const UserBlock& block);

// Reads the user block of a file and checks that every byte of it is as encode_user_block writes
// it, that the schema is one we know, and that the file has the size it states. Throws
// core::Error(kNotFound) when the file cannot be read, kDataLoss when it is damaged or not a fabric
// database, kFailedPrecondition when its schema is newer than this program.
[[nodiscard]] UserBlock read_user_block(const std::filesystem::path& path);

}  // namespace weft::storage
