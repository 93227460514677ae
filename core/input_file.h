#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/digest.h"

namespace weft::core {

// A file to be read, held open: what is checked and what is read later are one file, whatever
// happens to its name meanwhile.
class InputFile {
 public:
  // Throws Error: kNotFound when it cannot be opened, kInvalidArgument when it is not a plain file.
  explicit InputFile(const std::filesystem::path& path);
  // Bytes in memory, as a file of the name `name`. Throws Error(kResourceExhausted) when there is
  // no room for a copy.
  InputFile(std::string_view bytes, std::string name);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;

  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::uint64_t size_bytes() const { return size_bytes_; }
  // The bytes from `offset` on, at most `count`. Throws Error(kUnavailable) when the disk fails.
  [[nodiscard]] std::string read(std::uint64_t offset, std::size_t count) const;
  // Digest of everything from `offset` on.
  [[nodiscard]] Digest digest(std::uint64_t offset) const;

 private:
  std::size_t read_into(std::uint64_t offset, char* data, std::size_t count) const;

  std::string name_;
  int descriptor_ = -1;
  std::uint64_t size_bytes_ = 0;
};

}  // namespace weft::core
