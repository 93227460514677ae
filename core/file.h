#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace weft::core {

// Reads a whole file. Throws Error(kNotFound) when it cannot be opened and
// Error(kResourceExhausted) when it is larger than `limit_bytes`.
[[nodiscard]] std::string read_file(const std::filesystem::path& path,
                                    std::uint64_t limit_bytes = std::uint64_t{4} << 30);

// Writes beside, syncs, renames, syncs the folder: a reader sees the old file or the new one, and
// after return the new one survives a power loss. Throws Error(kUnavailable) naming the path.
void write_file_atomically(const std::filesystem::path& path, std::string_view data);

// Writes what publish_file is to publish. Throws Error(kUnavailable) naming the path, of which a
// part may be written then.
void write_file_unsynced(const std::filesystem::path& path, std::string_view data);

// The last steps of write_file_atomically, of a file that is already written: sync `from`, rename
// it to `to`, sync the folder. Both paths are in one file system.
void publish_file(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace weft::core
