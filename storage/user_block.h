#pragma once

#include <cstdint>
#include <string>
#include <string_view>

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

// Checks that `bytes`, the first kUserBlockBytes of a file, are every one as encode_user_block
// writes them, that the schema is one we know, and that the file has the size it states. Throws
// core::Error(kDataLoss) when it is damaged or not a fabric database, kFailedPrecondition when its
// schema is newer than this program; `name` stands for the file in messages.
[[nodiscard]] UserBlock parse_user_block(std::string_view bytes, std::uint64_t file_bytes,
                                         const std::string& name);

}  // namespace weft::storage
