#include "storage/h5_filters.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <new>

#include <libdeflate.h>

#include "core/check.h"
#include "core/parallel.h"

namespace weft::storage::h5 {

static_assert(std::endian::native == std::endian::little, "words are summed as they lie");

namespace {

constexpr int kDeflateLevel = 1;
constexpr std::uint32_t kDeflateIsSecond = 1U << 1;  // behind shuffle

struct Freed {
  void operator()(libdeflate_compressor* compressor) const {
    libdeflate_free_compressor(compressor);
  }
  void operator()(libdeflate_decompressor* decompressor) const {
    libdeflate_free_decompressor(decompressor);
  }
};

// First bytes of all elements, then second bytes, and so on, `stride` bytes apart. The number of
// bytes is a constant where it can be: such loops become vector instructions.
template <std::size_t kBytes>
void shuffle(const std::byte* __restrict from, std::size_t count, std::size_t stride,
             std::byte* __restrict to) {
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t b = 0; b < kBytes; ++b) {
      to[b * stride + i] = from[i * kBytes + b];
    }
  }
}

template <std::size_t kBytes>
void unshuffle(const std::byte* __restrict from, std::size_t count, std::byte* __restrict to) {
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t b = 0; b < kBytes; ++b) {
      to[i * kBytes + b] = from[b * count + i];
    }
  }
}

// What is missing of the chunk is zero. Elements of one byte stay where they are.
std::string shuffled(std::span<const std::byte> data, std::size_t chunk_bytes,
                     std::size_t element_bytes) {
  std::string bytes(chunk_bytes, '\0');
  const std::size_t stride = chunk_bytes / element_bytes;
  const std::size_t held = data.size() / element_bytes;
  auto* const to = reinterpret_cast<std::byte*>(bytes.data());
  switch (element_bytes) {
    case 1:
      std::copy(data.begin(), data.end(), to);
      break;
    case 2:
      shuffle<2>(data.data(), held, stride, to);
      break;
    case 4:
      shuffle<4>(data.data(), held, stride, to);
      break;
    case 8:
      shuffle<8>(data.data(), held, stride, to);
      break;
    default:
      for (std::size_t b = 0; b < element_bytes; ++b) {
        for (std::size_t i = 0; i < held; ++i) {
          to[b * stride + i] = data[i * element_bytes + b];
        }
      }
  }
  return bytes;
}

// REQUIRES: both have the same size, a multiple of element_bytes.
void unshuffled(std::span<const std::byte> bytes, std::size_t element_bytes,
                std::span<std::byte> data) {
  const std::size_t count = bytes.size() / element_bytes;
  switch (element_bytes) {
    case 1:
      std::copy(bytes.begin(), bytes.end(), data.begin());
      break;
    case 2:
      unshuffle<2>(bytes.data(), count, data.data());
      break;
    case 4:
      unshuffle<4>(bytes.data(), count, data.data());
      break;
    case 8:
      unshuffle<8>(bytes.data(), count, data.data());
      break;
    default:
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t b = 0; b < element_bytes; ++b) {
          data[i * element_bytes + b] = bytes[b * count + i];
        }
      }
  }
}

// Of a sum of words, modulo 65535. HDF5 folds sums, so that none but zero becomes zero.
std::uint64_t reduced(std::uint64_t sum) { return sum == 0 ? 0 : (sum - 1) % 0xffffU + 1; }

// The compiler makes vector instructions of these; it makes none of loops over arrays.
constexpr std::size_t kColumns = 8;
using Words = std::uint16_t __attribute__((vector_size(kColumns * sizeof(std::uint16_t))));
using Sums = std::uint32_t __attribute__((vector_size(kColumns * sizeof(std::uint32_t))));

// HDF5's: the sum of all big-endian words, and the sum of the sums up to each. Words are summed as
// they lie: one with its bytes exchanged is 256 times itself modulo 65535, and so are the sums.
// Each column of a block is summed on its own; word i of n is in the sum of sums n - i times.
std::uint32_t fletcher32(std::span<const std::byte> bytes) {
  constexpr std::size_t kRows = 360;  // the most whose sums of sums fit into 32 bits
  std::uint64_t first = 0;
  std::uint64_t second = 0;
  while (bytes.size() >= 2 * kColumns) {
    const std::size_t rows = std::min(kRows, bytes.size() / (2 * kColumns));
    Sums sums{};
    Sums sums_of_sums{};
    for (std::size_t row = 0; row < rows; ++row) {
      Words words;
      std::memcpy(&words, bytes.data() + row * sizeof(words), sizeof(words));
      sums += __builtin_convertvector(words, Sums);
      sums_of_sums += sums;
    }
    second += first * (rows * kColumns);
    for (std::size_t i = 0; i < kColumns; ++i) {
      first += sums[i];
      second += kColumns * std::uint64_t{sums_of_sums[i]} - i * sums[i];
    }
    first = reduced(first);
    second = reduced(second);
    bytes = bytes.subspan(rows * 2 * kColumns);
  }
  while (!bytes.empty()) {  // an odd byte at the end stands for a word, too
    std::uint16_t word = 0;
    const std::size_t held = std::min(sizeof(word), bytes.size());
    std::memcpy(&word, bytes.data(), held);
    first += word;
    second += first;
    bytes = bytes.subspan(held);
  }
  const auto as_big_endian = [](std::uint64_t sum) {
    return __builtin_bswap16(static_cast<std::uint16_t>(reduced(sum)));
  };
  return static_cast<std::uint32_t>(as_big_endian(second)) << 16 | as_big_endian(first);
}

// Whether `stream` is one whole stream of zlib's format that unfolds to exactly `data`.
bool inflates(std::span<const std::byte> stream, std::span<std::byte> data) {
  const std::unique_ptr<libdeflate_decompressor, Freed> decompressor(
      libdeflate_alloc_decompressor());
  if (!decompressor) {
    throw std::bad_alloc();
  }
  std::size_t taken = 0;
  // Without a place for its size, `data` has to be filled.
  return libdeflate_zlib_decompress_ex(decompressor.get(), stream.data(), stream.size(),
                                       data.data(), data.size(), &taken,
                                       nullptr) == LIBDEFLATE_SUCCESS &&
         taken == stream.size();
}

FilteredChunk filtered(std::span<const std::byte> data, std::size_t chunk_bytes,
                       std::size_t element_bytes, bool compress) {
  FilteredChunk chunk;
  if (!compress) {
    chunk.bytes = shuffled(data, chunk_bytes, 1);
  } else {
    const std::unique_ptr<libdeflate_compressor, Freed> compressor(
        libdeflate_alloc_compressor(kDeflateLevel));
    if (!compressor) {
      throw std::bad_alloc();
    }
    const std::string plain = shuffled(data, chunk_bytes, element_bytes);
    chunk.bytes.resize(plain.size());
    const std::size_t size = libdeflate_zlib_compress(compressor.get(), plain.data(), plain.size(),
                                                      chunk.bytes.data(), chunk.bytes.size());
    if (size == 0) {  // it has no room in as many bytes
      chunk.bytes = plain;
      chunk.skipped = kDeflateIsSecond;
    } else {
      chunk.bytes.resize(size);
    }
  }
  const std::uint32_t checksum = fletcher32(std::as_bytes(std::span(chunk.bytes)));
  chunk.bytes.append(reinterpret_cast<const char*>(&checksum), sizeof(checksum));
  return chunk;
}

}  // namespace

std::vector<FilteredChunk> filtered_chunks(std::span<const std::byte> data, std::size_t chunk_bytes,
                                           std::size_t element_bytes, bool compress) {
  CHECK(chunk_bytes > 0 && element_bytes > 0);
  CHECK_EQ(chunk_bytes % element_bytes, 0U);
  CHECK_EQ(data.size() % element_bytes, 0U);
  std::vector<FilteredChunk> chunks((data.size() + chunk_bytes - 1) / chunk_bytes);
  core::in_parallel(chunks.size(), [&](std::size_t i) {
    const std::size_t first = i * chunk_bytes;
    const auto held = data.subspan(first, std::min(chunk_bytes, data.size() - first));
    chunks[i] = filtered(held, chunk_bytes, element_bytes, compress);
  });
  return chunks;
}

bool undo_filters(std::string_view stored, const ChunkFilters& filters, std::size_t element_bytes,
                  std::span<std::byte> data) {
  CHECK_EQ(data.size() % element_bytes, 0U);
  std::span<const std::byte> bytes = std::as_bytes(std::span(stored));
  if (filters.fletcher32) {
    std::uint32_t checksum = 0;
    if (bytes.size() < sizeof(checksum)) {
      return false;
    }
    std::memcpy(&checksum, bytes.last(sizeof(checksum)).data(), sizeof(checksum));
    bytes = bytes.first(bytes.size() - sizeof(checksum));
    if (fletcher32(bytes) != checksum) {
      return false;
    }
  }
  std::unique_ptr<std::byte[]> unfolded;
  if (filters.deflate) {
    if (!filters.shuffle) {
      return inflates(bytes, data);
    }
    unfolded = std::make_unique_for_overwrite<std::byte[]>(data.size());
    if (!inflates(bytes, {unfolded.get(), data.size()})) {
      return false;
    }
    bytes = {unfolded.get(), data.size()};
  }
  if (bytes.size() != data.size()) {
    return false;
  }
  unshuffled(bytes, filters.shuffle ? element_bytes : 1, data);
  return true;
}

}  // namespace weft::storage::h5
