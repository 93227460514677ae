#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace weft::core {

// A SHA-256 digest: the name of every blob, shard and database content.
struct Digest {
  std::array<std::uint8_t, 32> bytes{};

  // clang-tidy 14 sees the 0 with which the compiler compares.
  auto operator<=>(const Digest&) const = default;  // NOLINT(modernize-use-nullptr)
  [[nodiscard]] std::string hex() const;            // 64 lower-case digits
  [[nodiscard]] std::string binary() const;         // the 32 bytes
  [[nodiscard]] static std::optional<Digest> from_hex(std::string_view text);
  [[nodiscard]] static std::optional<Digest> from_binary(std::string_view bytes);
};

// Digests a stream of bytes. Fields of different meaning must be told apart by the caller: use
// field(), which hashes the length first.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;
  Hasher(Hasher&&) noexcept;
  Hasher& operator=(Hasher&&) noexcept;

  void bytes(std::string_view data);
  void field(std::string_view data);  // length as 8 little-endian bytes, then the data
  void number(std::uint64_t value);   // 8 little-endian bytes
  [[nodiscard]] Digest finish();      // once; the hasher is spent

 private:
  struct State;
  std::unique_ptr<State> state_;
};

[[nodiscard]] Digest digest_of(std::string_view data);

// Digest of a file from byte `offset` on. Throws Error(kNotFound) when it cannot be read.
[[nodiscard]] Digest digest_of_file(const std::filesystem::path& path, std::uint64_t offset = 0);

struct DigestHash {
  std::size_t operator()(const Digest& digest) const;
};

}  // namespace weft::core
