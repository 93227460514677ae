#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

// The plain form in which one process hands arrays to another: numbers of 8 little-endian bytes,
// and runs of bytes that begin with their length and end on a multiple of 8. What is read is only
// data: every length is checked against what is there.

namespace weft::core {

// Writes to a descriptor. Throws core::Error(kResourceExhausted) when it takes no more.
class FlatWriter {
 public:
  // Does not own `descriptor`, whose position is where writing begins.
  explicit FlatWriter(int descriptor);

  void number(std::uint64_t value);
  void bytes(std::span<const std::byte> data);
  void text(std::string_view text);
  // REQUIRES: called last; what was not flushed may be missing.
  void flush();

 private:
  void put(const void* data, std::size_t size);

  int descriptor_;
  std::string buffer_;
};

// Reads what a FlatWriter wrote. Throws core::Error(kDataLoss) when it asks for more than there is.
class FlatReader {
 public:
  // REQUIRES: `data` outlives the reader and is aligned to 8 bytes.
  explicit FlatReader(std::span<const std::byte> data) : rest_(data) {}

  [[nodiscard]] std::uint64_t number();
  // Aligned to 8 bytes; part of what the reader was made of.
  [[nodiscard]] std::span<const std::byte> bytes();
  [[nodiscard]] std::string text();
  // Throws unless everything was read.
  void end() const;

 private:
  std::span<const std::byte> rest_;
};

}  // namespace weft::core
