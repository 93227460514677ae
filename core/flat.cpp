#include "core/flat.h"

#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <system_error>

#include <unistd.h>

#include "core/error.h"

namespace weft::core {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

namespace {

constexpr std::size_t kBufferBytes = std::size_t{64} << 10;
constexpr std::size_t kAlignment = 8;

std::size_t padding_of(std::uint64_t size) { return (kAlignment - size % kAlignment) % kAlignment; }

void write_all(int descriptor, const char* data, std::size_t size) {
  std::size_t written = 0;
  while (written < size) {
    const ssize_t n = ::write(descriptor, data + written, size - written);
    if (n < 0 && errno != EINTR) {
      throw Error(Code::kResourceExhausted, "what was read from the file has no room: " +
                                                std::generic_category().message(errno));
    }
    written += n > 0 ? static_cast<std::size_t>(n) : 0;
  }
}

[[noreturn]] void throw_short() {
  throw Error(Code::kDataLoss, "what came back from reading the file is not whole");
}

}  // namespace

FlatWriter::FlatWriter(int descriptor) : descriptor_(descriptor) { buffer_.reserve(kBufferBytes); }

void FlatWriter::put(const void* data, std::size_t size) {
  if (buffer_.size() + size > kBufferBytes) {
    flush();
  }
  if (size == 0) {
    return;
  }
  if (size > kBufferBytes) {
    write_all(descriptor_, static_cast<const char*>(data), size);
  } else {
    buffer_.append(static_cast<const char*>(data), size);
  }
}

void FlatWriter::flush() {
  write_all(descriptor_, buffer_.data(), buffer_.size());
  buffer_.clear();
}

void FlatWriter::number(std::uint64_t value) { put(&value, sizeof(value)); }

void FlatWriter::bytes(std::span<const std::byte> data) {
  constexpr std::array<char, kAlignment> kZeros{};
  number(data.size());
  put(data.data(), data.size());
  put(kZeros.data(), padding_of(data.size()));
}

void FlatWriter::text(std::string_view text) { bytes(std::as_bytes(std::span(text))); }

std::uint64_t FlatReader::number() {
  std::uint64_t value = 0;
  if (rest_.size() < sizeof(value)) {
    throw_short();
  }
  std::memcpy(&value, rest_.data(), sizeof(value));
  rest_ = rest_.subspan(sizeof(value));
  return value;
}

std::span<const std::byte> FlatReader::bytes() {
  const std::uint64_t size = number();
  if (size > rest_.size() || padding_of(size) > rest_.size() - size) {
    throw_short();
  }
  const std::span<const std::byte> data = rest_.first(size);
  rest_ = rest_.subspan(size + padding_of(size));
  return data;
}

std::string FlatReader::text() {
  const std::span<const std::byte> data = bytes();
  return {reinterpret_cast<const char*>(data.data()), data.size()};
}

void FlatReader::end() const {
  if (!rest_.empty()) {
    throw_short();
  }
}

}  // namespace weft::core
