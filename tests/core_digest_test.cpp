#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "core/digest.h"
#include "core/error.h"
#include "core/file.h"

namespace weft::core {
namespace {

// The examples of FIPS 180-4.
TEST(Digest, IsSha256) {
  EXPECT_EQ(digest_of("abc").hex(),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(digest_of("").hex(),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(digest_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq").hex(),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(Digest, SurvivesTheWayThroughHexAndBytes) {
  const Digest digest = digest_of("abc");
  EXPECT_EQ(Digest::from_hex(digest.hex()), digest);
  EXPECT_EQ(Digest::from_binary(digest.binary()), digest);
}

TEST(Digest, RefusesWhatIsNotADigest) {
  const std::string hex = digest_of("abc").hex();
  EXPECT_FALSE(Digest::from_hex("").has_value());
  EXPECT_FALSE(Digest::from_hex(hex.substr(1)).has_value());
  EXPECT_FALSE(Digest::from_hex(hex + "0").has_value());
  for (const char wrong : {'g', 'B', ' '}) {  // lower case only
    std::string other = hex;
    other[0] = wrong;
    EXPECT_FALSE(Digest::from_hex(other).has_value()) << wrong;
  }
  EXPECT_FALSE(Digest::from_binary("short").has_value());
}

TEST(Hasher, BytesMayComeInAnyPieces) {
  Hasher hasher;
  hasher.bytes("a");
  hasher.bytes("");
  hasher.bytes("bc");
  EXPECT_EQ(hasher.finish(), digest_of("abc"));
}

TEST(Hasher, FieldsAreToldApart) {
  const auto digest = [](const std::string& first, const std::string& second) {
    Hasher hasher;
    hasher.field(first);
    hasher.field(second);
    return hasher.finish();
  };
  EXPECT_NE(digest("ab", "c"), digest("a", "bc"));
  EXPECT_NE(digest("abc", ""), digest("", "abc"));
  EXPECT_EQ(digest("ab", "c"), digest("ab", "c"));
}

TEST(Hasher, NumbersAreEightLittleEndianBytes) {
  Hasher hasher;
  hasher.number(0x0102030405060708U);
  EXPECT_EQ(hasher.finish(), digest_of("\x08\x07\x06\x05\x04\x03\x02\x01"));
}

TEST(DigestOfFile, CoversTheFileFromAnOffset) {
  const std::filesystem::path path =
      std::filesystem::path(testing::TempDir()) / "weft_digest_of_file";
  std::string data(3 << 20, 'x');
  data[2 << 20] = 'y';
  write_file_atomically(path, data);
  EXPECT_EQ(digest_of_file(path), digest_of(data));
  EXPECT_EQ(digest_of_file(path, 1000), digest_of(data.substr(1000)));
  EXPECT_EQ(digest_of_file(path, data.size()), digest_of(""));
  std::filesystem::remove(path);
  try {
    (void)digest_of_file(path);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), Code::kNotFound);
  }
}

}  // namespace
}  // namespace weft::core
