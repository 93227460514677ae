#include "core/digest.h"

#include <cstring>
#include <fstream>
#include <vector>

#include <openssl/evp.h>

#include "core/check.h"
#include "core/error.h"

namespace weft::core {

namespace {

int hex_value(char c) {
  if (c >= '0' && c <= '9') {
    return c - '0';
  }
  if (c >= 'a' && c <= 'f') {
    return c - 'a' + 10;
  }
  return -1;
}

}  // namespace

std::string Digest::hex() const {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  text.reserve(64);
  for (const std::uint8_t byte : bytes) {
    text.push_back(kDigits[byte >> 4]);
    text.push_back(kDigits[byte & 15]);
  }
  return text;
}

std::string Digest::binary() const {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::optional<Digest> Digest::from_hex(std::string_view text) {
  if (text.size() != 64) {
    return std::nullopt;
  }
  Digest digest;
  for (std::size_t i = 0; i < 32; ++i) {
    const int high = hex_value(text[2 * i]);
    const int low = hex_value(text[2 * i + 1]);
    if (high < 0 || low < 0) {
      return std::nullopt;
    }
    digest.bytes[i] = static_cast<std::uint8_t>(high * 16 + low);
  }
  return digest;
}

std::optional<Digest> Digest::from_binary(std::string_view bytes) {
  Digest digest;
  if (bytes.size() != digest.bytes.size()) {
    return std::nullopt;
  }
  std::memcpy(digest.bytes.data(), bytes.data(), bytes.size());
  return digest;
}

struct Hasher::State {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  State() { CHECK_EQ(EVP_DigestInit_ex(context, EVP_sha256(), nullptr), 1); }
  ~State() { EVP_MD_CTX_free(context); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  State(State&&) = delete;
  State& operator=(State&&) = delete;
};

Hasher::Hasher() : state_(std::make_unique<State>()) {}
Hasher::~Hasher() = default;
Hasher::Hasher(Hasher&&) noexcept = default;
Hasher& Hasher::operator=(Hasher&&) noexcept = default;

void Hasher::bytes(std::string_view data) {
  CHECK_EQ(EVP_DigestUpdate(state_->context, data.data(), data.size()), 1);
}

void Hasher::field(std::string_view data) {
  number(data.size());
  bytes(data);
}

void Hasher::number(std::uint64_t value) {
  std::array<char, 8> little_endian{};
  for (std::size_t i = 0; i < 8; ++i) {
    little_endian[i] = static_cast<char>(value >> (8 * i) & 0xff);
  }
  bytes({little_endian.data(), little_endian.size()});
}

Digest Hasher::finish() {
  Digest digest;
  unsigned length = 0;
  CHECK_EQ(EVP_DigestFinal_ex(state_->context, digest.bytes.data(), &length), 1);
  CHECK_EQ(length, digest.bytes.size());
  return digest;
}

Digest digest_of(std::string_view data) {
  Hasher hasher;
  hasher.bytes(data);
  return hasher.finish();
}

Digest digest_of_file(const std::filesystem::path& path, std::uint64_t offset) {
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    throw Error(Code::kNotFound, "cannot read " + path.string());
  }
  in.seekg(static_cast<std::streamoff>(offset));
  Hasher hasher;
  std::vector<char> buffer(1 << 20);
  while (in) {
    in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    hasher.bytes({buffer.data(), static_cast<std::size_t>(in.gcount())});
  }
  return hasher.finish();
}

std::size_t DigestHash::operator()(const Digest& digest) const {
  std::size_t hash = 0;
  std::memcpy(&hash, digest.bytes.data(), sizeof(hash));
  return hash;
}

}  // namespace weft::core
