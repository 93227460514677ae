#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "core/random.h"
#include "storage/pieces.h"
#include "tests/storage_test_database.h"

namespace weft::storage {
namespace {

std::string noise(std::size_t count, std::uint64_t seed) {
  core::Random random(seed, 0);
  std::string bytes(count, '\0');
  for (char& byte : bytes) {
    byte = static_cast<char>(static_cast<int>(random.uniform() * 256) & 0xff);
  }
  return bytes;
}

// Cuts `bytes` that come in calls of `step`; checks that the pieces are the bytes.
std::vector<Piece> cut(const std::string& bytes, std::vector<std::uint64_t> boundaries = {},
                       std::size_t step = 1 << 20) {
  std::vector<Piece> pieces;
  std::string together;
  PieceCutter cutter(std::move(boundaries), [&](const Piece& piece, std::string_view data) {
    EXPECT_EQ(piece.digest, core::digest_of(data));
    EXPECT_EQ(piece.size_bytes, data.size());
    pieces.push_back(piece);
    together += data;
  });
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    cutter.add(std::string_view(bytes).substr(at, step));
  }
  cutter.finish();
  EXPECT_EQ(together, bytes);
  return pieces;
}

std::uint64_t shared_bytes(const std::vector<Piece>& a, const std::vector<Piece>& b) {
  std::map<core::Digest, std::uint64_t> of_a;
  for (const Piece& piece : a) {
    of_a[piece.digest] = piece.size_bytes;
  }
  std::uint64_t shared = 0;
  for (const Piece& piece : b) {
    shared += of_a.contains(piece.digest) ? piece.size_bytes : 0;
  }
  return shared;
}

TEST(Pieces, TogetherAreTheFileAndDoNotDependOnHowItsBytesCome) {
  const std::string bytes = noise(3'000'000, 1);
  const std::vector<Piece> pieces = cut(bytes);
  EXPECT_EQ(cut(bytes, {}, 4'099), pieces);
  EXPECT_EQ(cut(bytes, {}, 777'777), pieces);
  EXPECT_GT(pieces.size(), 25U);
  EXPECT_LT(pieces.size(), 80U);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    EXPECT_LE(pieces[i].size_bytes, kPieceLimitBytes);
    EXPECT_TRUE(pieces[i].size_bytes > kPieceLeastBytes || i + 1 == pieces.size());
  }
  EXPECT_TRUE(cut("").empty());
  EXPECT_EQ(cut("x").size(), 1U);
}

TEST(Pieces, OfBytesThatMoved_AreTheSame) {
  const std::string bytes = noise(4'000'000, 2);
  const std::vector<Piece> before = cut(bytes);
  std::string moved = bytes;
  moved.insert(1'000'000, "a few bytes more");
  EXPECT_GT(shared_bytes(before, cut(moved)), bytes.size() - 2 * kPieceLimitBytes);
}

TEST(Pieces, EndAtBoundariesUnlessTooLittleLiesBetween) {
  const std::string bytes = noise(200'000, 3);
  const std::vector<Piece> pieces = cut(bytes, {10, 8'000, 8'100, 100'000});
  EXPECT_EQ(pieces[0].size_bytes, 8'000U);
  std::uint64_t at = 0;
  std::vector<std::uint64_t> cuts;
  for (const Piece& piece : pieces) {
    at += piece.size_bytes;
    cuts.push_back(at);
  }
  EXPECT_EQ(std::count(cuts.begin(), cuts.end(), 100'000U), 1);
  EXPECT_EQ(std::count(cuts.begin(), cuts.end(), 8'100U), 0);
}

TEST(Pieces, OfEqualBytesWithoutEnd_HaveTheLargestSize) {
  const std::vector<Piece> pieces = cut(std::string(1'000'000, '\0'));
  EXPECT_EQ(pieces[0].size_bytes, pieces[1].size_bytes);
  EXPECT_EQ(pieces[0].digest, pieces[1].digest);
}

TEST(Pieces, AreWrittenAndReadBack) {
  const std::vector<Piece> pieces = cut(noise(500'000, 4));
  EXPECT_EQ(decode_pieces(encode_pieces(pieces)), pieces);
  EXPECT_TRUE(decode_pieces("").empty());
  EXPECT_THROW((void)decode_pieces("x"), core::Error);
  EXPECT_THROW((void)decode_pieces(std::string(36, '\0')), core::Error);
  EXPECT_THROW((void)decode_pieces(std::string(36, '\xff')), core::Error);
}

// What two colours of one cloth share: all that light does not enter.
TEST(Pieces, OfDatabasesThatDifferInLightOnly_ShareWhatIsStoredOfTheRest) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / "weft_pieces_of_databases";
  std::filesystem::create_directories(folder);
  FabricDatabase database = small_database();
  const std::size_t pixels = database.ssdf_basis.size() / database.pca_components;
  core::Random random(5, 0);
  // A basis that does not compress, and of some size.
  database.pca_components = 64;
  database.ssdf_basis.resize(pixels * database.pca_components);
  for (float& value : database.ssdf_basis) {
    value = random.uniform() - 0.5F;
  }
  database.ssdf.assign(database.cell_of_segment.size() * database.pca_components, 0);
  write_database(database, folder / "one.h5");
  for (float& value : database.transfer) {
    value *= 1.5F;
  }
  database.materials[0].c_tt = {0.1F, 0.1F, 0.1F};
  database.c_s[0] += 1;
  database.description_json += "   ";
  write_database(database, folder / "other.h5");

  EXPECT_FALSE(piece_boundaries(folder / "one.h5").empty());
  const std::vector<Piece> one = cut_file(folder / "one.h5", {});
  const std::vector<Piece> other = cut_file(folder / "other.h5", {});
  EXPECT_EQ(cut_file(folder / "one.h5", {}), one);
  EXPECT_GE(shared_bytes(one, other), database.ssdf_basis.size() * sizeof(float) * 8 / 10);

  // What is no database has no boundaries, and is cut all the same.
  core::write_file_atomically(folder / "text", noise(100'000, 6));
  EXPECT_TRUE(piece_boundaries(folder / "text").empty());
  EXPECT_FALSE(cut_file(folder / "text", {}).empty());
  EXPECT_THROW((void)cut_file(folder / "nothing", {}), core::Error);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace weft::storage
