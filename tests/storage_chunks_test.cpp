#include <algorithm>
#include <cstring>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <unistd.h>

#include "core/error.h"
#include "core/file.h"
#include "core/random.h"
#include "storage/h5_filters.h"
#include "storage/h5_reader.h"

// Chunks as HDF5's own filters write them and as nobody should, in files of one dataset.

namespace weft::storage::h5 {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::byte>;
using Extents = std::vector<hsize_t>;

constexpr const char* kPath = "/data";
constexpr Decoding kDecodings[] = {Decoding::kInThisThread, Decoding::kByAllThreads};

struct Dataset {
  Element element = Element::kF32;
  std::size_t element_bytes = 4;
  Extents shape;
  Extents chunk;
  ChunkFilters filters{true, true, true};
};

std::size_t bytes_of(const Dataset& made) {
  std::size_t bytes = made.element_bytes;
  for (const hsize_t extent : made.shape) {
    bytes *= extent;
  }
  return bytes;
}

// Repeats itself enough for deflate to shorten it, and never is a chunk like another.
Bytes some_bytes(std::size_t count) {
  core::Random random(5, 0);
  Bytes bytes(count);
  for (std::size_t i = 0; i < count; ++i) {
    bytes[i] = static_cast<std::byte>(i % 4 == 3 ? random.below(256) : i / 64);
  }
  return bytes;
}

Handle type_for(const Dataset& made) {
  switch (made.element) {
    case Element::kU16:
      return Handle(H5Tcopy(H5T_STD_U16LE));
    case Element::kF32:
      return Handle(H5Tcopy(H5T_IEEE_F32LE));
    case Element::kU64:
      return Handle(H5Tcopy(H5T_STD_U64LE));
    default: {
      Handle text(H5Tcopy(H5T_C_S1));
      H5Tset_size(text.id(), made.element_bytes);
      H5Tset_strpad(text.id(), H5T_STR_NULLPAD);
      H5Tset_cset(text.id(), H5T_CSET_UTF8);
      return text;
    }
  }
}

class ChunksTest : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(file_); }

  // The bytes of a file with this dataset, which `fill` fills.
  [[nodiscard]] std::string file_with(const Dataset& made,
                                      const std::function<void(hid_t)>& fill) const {
    const Session session;
    {
      const Handle file(H5Fcreate(file_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT));
      const Handle properties(H5Pcreate(H5P_DATASET_CREATE));
      H5Pset_chunk(properties.id(), static_cast<int>(made.chunk.size()), made.chunk.data());
      if (made.filters.shuffle) {
        H5Pset_shuffle(properties.id());
      }
      if (made.filters.deflate) {
        H5Pset_deflate(properties.id(), 6);
      }
      if (made.filters.fletcher32) {
        H5Pset_fletcher32(properties.id());
      }
      fill_dataset(made, file.id(), properties.id(), fill);
    }
    return core::read_file(file_);
  }

  static void fill_dataset(const Dataset& made, hid_t file, hid_t properties,
                           const std::function<void(hid_t)>& fill) {
    const Handle space(
        H5Screate_simple(static_cast<int>(made.shape.size()), made.shape.data(), nullptr));
    const Handle type = type_for(made);
    const Handle dataset(
        H5Dcreate2(file, kPath, type.id(), space.id(), H5P_DEFAULT, properties, H5P_DEFAULT));
    ASSERT_GE(dataset.id(), 0);
    fill(dataset.id());
  }

  [[nodiscard]] std::string file_with(const Dataset& made, const Bytes& data) const {
    return file_with(made, [&](hid_t dataset) {
      const Handle type = type_for(made);
      ASSERT_GE(H5Dwrite(dataset, type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data()), 0);
    });
  }

  // With one chunk, at the beginning, that is stored as these bytes.
  [[nodiscard]] std::string file_with_chunk(const Dataset& made, const std::string& stored,
                                            std::uint32_t skipped = 0) const {
    return file_with(made, [&](hid_t dataset) {
      const Extents at(made.shape.size(), 0);
      ASSERT_GE(
          H5Dwrite_chunk(dataset, H5P_DEFAULT, skipped, at.data(), stored.size(), stored.data()),
          0);
    });
  }

  static Bytes read(const std::string& file, Decoding decoding) {
    Reader reader(std::as_bytes(std::span(file)), 0, decoding);
    const Reader::Info info = reader.info(kPath);
    reader.admit(kPath, info);
    Bytes data(info.bytes);
    reader.read(kPath, info, data);
    return data;
  }

  static std::string complaint_about(const std::string& file,
                                     Decoding decoding = Decoding::kInThisThread) {
    try {
      read(file, decoding);
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kDataLoss) << error.what();
      return error.what();
    }
    return "";
  }

  // What HDF5 itself makes of the dataset.
  [[nodiscard]] Bytes read_by_the_library(const Dataset& made, const std::string& file) const {
    core::write_file_atomically(file_, file);
    const Session session;
    const Handle opened(H5Fopen(file_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
    const Handle dataset(H5Dopen2(opened.id(), kPath, H5P_DEFAULT));
    const Handle type = type_for(made);
    Bytes data(bytes_of(made));
    EXPECT_GE(H5Dread(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data()), 0);
    return data;
  }

  std::filesystem::path file_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("weft_chunks_") + testing::UnitTest::GetInstance()->current_test_info()->name() +
       std::to_string(::getpid()));
};

// All combinations of filters, of which each is there or not.
std::vector<ChunkFilters> all_filters() {
  std::vector<ChunkFilters> all;
  for (unsigned bits = 0; bits < 8; ++bits) {
    all.push_back({(bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0});
  }
  return all;
}

TEST_F(ChunksTest, WhatTheLibrarysOwnFiltersWroteReadsTheSame) {
  const Dataset all_made[] = {
      {Element::kF32, 4, {1000, 3}, {64, 3}, {}},  // the last chunk is cut
      {Element::kF32, 4, {40000}, {40000}, {}},    // more than a block of the checksum
      {Element::kU16, 2, {700}, {1}, {}},          // more than a batch
      {Element::kU16, 2, {9, 7, 5, 3}, {4, 7, 5, 3}, {}},
      {Element::kU64, 8, {9, 7, 5}, {4, 3, 2}, {}},  // cut along every axis
      {Element::kU64, 8, {9, 7, 5}, {2, 4, 5}, {}},
      {Element::kF32, 4, {5, 6, 7}, {5, 6, 2}, {}},
      {Element::kText, 7, {13}, {5}, {}},  // an odd number of bytes
      {Element::kText, 1, {33}, {8}, {}},
  };
  for (Dataset made : all_made) {
    const Bytes data = some_bytes(bytes_of(made));
    for (const ChunkFilters& filters : all_filters()) {
      made.filters = filters;
      const std::string file = file_with(made, data);
      for (const Decoding decoding : kDecodings) {
        EXPECT_TRUE(read(file, decoding) == data)
            << to_string(Shape(made.shape.begin(), made.shape.end())) << filters.shuffle
            << filters.deflate << filters.fletcher32;
      }
    }
  }
}

TEST_F(ChunksTest, ChecksumsOfZerosAndOnesHoldAtAnyLength) {
  for (const std::byte value : {std::byte{0}, std::byte{0xff}}) {
    for (const std::size_t length : {1U, 2U, 15U, 16U, 17U, 31U, 5759U, 5760U, 5761U, 100001U}) {
      const Dataset made{Element::kText, length, {1}, {1}, {false, false, true}};
      const Bytes data(length, value);
      EXPECT_EQ(complaint_about(file_with(made, data)), "") << length;
    }
  }
}

TEST_F(ChunksTest, SomeRowsAreTheRowsOfTheWhole) {
  for (const Extents& chunk : {Extents{8, 3, 4}, Extents{7, 2, 3}, Extents{29, 3, 4}}) {
    const Dataset made{Element::kF32, 4, {29, 3, 4}, chunk};
    const Bytes data = some_bytes(bytes_of(made));
    const std::string file = file_with(made, data);
    const std::size_t row_bytes = data.size() / 29;
    Reader reader(std::as_bytes(std::span(file)), 0, Decoding::kByAllThreads);
    const Reader::Info info = reader.info(kPath);
    for (std::size_t first = 0; first < 29; ++first) {
      for (std::size_t count = 1; first + count <= 29; ++count) {
        Bytes rows(count * row_bytes);
        reader.read_rows(kPath, info, first, count, rows);
        ASSERT_EQ(std::memcmp(rows.data(), data.data() + first * row_bytes, rows.size()), 0)
            << first << " " << count;
      }
    }
  }
}

TEST_F(ChunksTest, EveryOtherByteInAChunkIsRefused) {
  const Dataset made{Element::kF32, 4, {100, 3}, {32, 3}};
  const std::string file = file_with(made, some_bytes(bytes_of(made)));
  const auto extents =
      Reader(std::as_bytes(std::span(file)), 0, Decoding::kInThisThread).chunks(kPath);
  ASSERT_EQ(extents.size(), 4U);
  for (const Reader::Extent& extent : extents) {
    for (std::uint64_t i = 0; i < extent.size_bytes; ++i) {
      std::string damaged = file;
      char& byte = damaged[extent.offset + i];
      byte = static_cast<char>(
          static_cast<unsigned char>(byte) ^
          (1 + core::Random(3, static_cast<std::uint32_t>(extent.offset + i)).below(255)));
      for (const Decoding decoding : kDecodings) {
        ASSERT_THAT(complaint_about(damaged, decoding), HasSubstr("/data is damaged"))
            << extent.offset << " " << i;
      }
    }
  }
}

// Of shuffle and deflate alone: no checksum stands before it.
class StreamTest : public ChunksTest {
 protected:
  // A chunk of so many of the dataset's bytes, shuffled and deflated.
  [[nodiscard]] std::string stream_of(std::size_t count) const {
    Bytes data = data_;
    data.resize(count);
    std::string stream = filtered_chunks(data, count, 4, true).front().bytes;
    return stream.substr(0, stream.size() - 4);
  }

  const Dataset made_{Element::kF32, 4, {256}, {256}, {true, true, false}};
  const Bytes data_ = some_bytes(1024);
};

TEST_F(StreamTest, ThatUnfoldsToMoreOrFewerBytesOrHasSomethingBehindItIsRefused) {
  EXPECT_TRUE(read(file_with_chunk(made_, stream_of(1024)), Decoding::kInThisThread) == data_);
  const std::string whole = stream_of(1024);
  for (const std::string& stream :
       {stream_of(1020), stream_of(1028), stream_of(4), stream_of(8192), whole + '\0',
        whole + whole, whole.substr(0, whole.size() - 1), whole.substr(0, 2), std::string(1, 'x'),
        stream_of(512) + stream_of(512)}) {
    EXPECT_THAT(complaint_about(file_with_chunk(made_, stream)), HasSubstr("/data"))
        << stream.size();
  }
}

TEST_F(StreamTest, WhoseOwnChecksumIsWrongIsRefused) {
  std::string stream = stream_of(1024);
  stream.back() = static_cast<char>(stream.back() ^ 1);
  EXPECT_THAT(complaint_about(file_with_chunk(made_, stream)), HasSubstr("/data is damaged"));
}

// The file says of each chunk which filters were left out.
TEST_F(ChunksTest, AWrongMaskOfFiltersIsRefusedOrReadAsTheLibraryReadsIt) {
  const Dataset made{Element::kF32, 4, {256}, {256}};
  const Bytes data = some_bytes(1024);
  const std::string chunk = filtered_chunks(data, 1024, 4, true).front().bytes;
  std::size_t read_otherwise = 0;
  for (std::uint32_t mask = 0; mask < 16; ++mask) {
    const std::string file = file_with_chunk(made, chunk, mask);
    // Without shuffle the bytes are others; all that is behind our three filters means nothing.
    if ((mask & 6) != 0) {
      EXPECT_THAT(complaint_about(file), HasSubstr("/data")) << mask;
      continue;
    }
    const Bytes found = read(file, Decoding::kInThisThread);
    EXPECT_TRUE(found == read_by_the_library(made, file)) << mask;
    EXPECT_EQ(found == data, (mask & 1) == 0) << mask;
    read_otherwise += found == data ? 0 : 1;
  }
  EXPECT_EQ(read_otherwise, 2U);
}

TEST_F(ChunksTest, AChunkAsItIsHasTheLengthOfItsShape) {
  const Dataset made{Element::kF32, 4, {256}, {256}};
  const Bytes data = some_bytes(1024);
  const std::string plain(reinterpret_cast<const char*>(data.data()), data.size());
  EXPECT_TRUE(read(file_with_chunk(made, plain, 7), Decoding::kInThisThread) == data);
  for (const std::string& stored : {plain + '\0', plain.substr(1), plain + "four"}) {
    EXPECT_THAT(complaint_about(file_with_chunk(made, stored, 7)),
                HasSubstr("shorter or longer than they should be"));
  }
}

TEST_F(ChunksTest, FiltersInAnotherOrderOrTwiceAreRefused) {
  const std::function<void(hid_t)> ways[] = {
      [](hid_t properties) {
        H5Pset_deflate(properties, 6);
        H5Pset_shuffle(properties);
      },
      [](hid_t properties) {
        H5Pset_fletcher32(properties);
        H5Pset_deflate(properties, 6);
      },
      [](hid_t properties) {
        H5Pset_deflate(properties, 6);
        H5Pset_deflate(properties, 6);
      },
  };
  const Dataset made{Element::kF32, 4, {256}, {256}};
  for (const auto& way : ways) {
    {
      const Session session;
      const Handle file(H5Fcreate(file_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT));
      const Handle properties(H5Pcreate(H5P_DATASET_CREATE));
      H5Pset_chunk(properties.id(), 1, made.chunk.data());
      way(properties.id());
      fill_dataset(made, file.id(), properties.id(), [&](hid_t dataset) {
        H5Dwrite(dataset, H5T_IEEE_F32LE, H5S_ALL, H5S_ALL, H5P_DEFAULT, some_bytes(1024).data());
      });
    }
    EXPECT_THAT(complaint_about(core::read_file(file_)), HasSubstr("uses filters in an order"));
  }
}

TEST_F(ChunksTest, AShuffleOfAnotherElementSizeIsRefused) {
  const Dataset made{Element::kF32, 4, {256}, {256}};
  std::string file = file_with(made, some_bytes(1024));
  const std::string name("shuffle\0\4\0\0\0", 12);  // the filter's name and its one value
  const std::size_t at = file.find(name);
  ASSERT_NE(at, std::string::npos);
  for (const char size : {'\0', '\1', '\2', '\10', '\x7f'}) {
    file[at + 8] = size;
    EXPECT_THAT(complaint_about(file), HasSubstr("is shuffled by another size")) << int{size};
  }
}

TEST(Filters, UndoneOnesGiveWhatWasFiltered) {
  for (const std::size_t element_bytes : {1U, 2U, 3U, 4U, 8U, 20U}) {
    for (const bool compress : {false, true}) {
      const std::size_t chunk_bytes = element_bytes * 101;
      const Bytes data = some_bytes(element_bytes * 250);
      const auto chunks = filtered_chunks(data, chunk_bytes, element_bytes, compress);
      ASSERT_EQ(chunks.size(), 3U);
      Bytes found;
      for (const FilteredChunk& chunk : chunks) {
        const ChunkFilters filters{compress, compress && chunk.skipped == 0, true};
        Bytes plain(chunk_bytes);
        ASSERT_TRUE(undo_filters(chunk.bytes, filters, element_bytes, plain));
        found.insert(found.end(), plain.begin(), plain.end());
      }
      EXPECT_TRUE(std::all_of(found.begin() + static_cast<std::ptrdiff_t>(data.size()), found.end(),
                              [](std::byte b) { return b == std::byte{0}; }));
      found.resize(data.size());
      EXPECT_TRUE(found == data) << element_bytes;
    }
  }
}

TEST(Filters, ChunksThatAreShorterThanTheirChecksumAreRefused) {
  Bytes data(8);
  for (std::size_t length = 0; length < 12; ++length) {
    EXPECT_FALSE(undo_filters(std::string(length, 'x'), {true, true, true}, 4, data));
    EXPECT_FALSE(undo_filters(std::string(length, 'x'), {false, false, true}, 4, data));
    EXPECT_EQ(undo_filters(std::string(length, 'x'), {true, false, false}, 4, data), length == 8);
  }
}

}  // namespace
}  // namespace weft::storage::h5
