#include "storage/h5_filters.h"

#include <algorithm>
#include <memory>
#include <new>
#include <string_view>

#include <libdeflate.h>

#include "core/check.h"
#include "core/parallel.h"

namespace weft::storage::h5 {

namespace {

constexpr int kDeflateLevel = 1;
constexpr std::uint32_t kDeflateIsSecond = 1U << 1;  // behind shuffle

struct Freed {
  void operator()(libdeflate_compressor* compressor) const {
    libdeflate_free_compressor(compressor);
  }
};

// First bytes of all elements, then second bytes, and so on; what is missing is zero. Elements of
// one byte stay where they are.
std::string shuffled(std::span<const std::byte> data, std::size_t chunk_bytes,
                     std::size_t element_bytes) {
  std::string bytes(chunk_bytes, '\0');
  const std::size_t count = chunk_bytes / element_bytes;
  const std::size_t held = data.size() / element_bytes;
  for (std::size_t b = 0; b < element_bytes; ++b) {
    char* const to = &bytes[b * count];
    for (std::size_t i = 0; i < held; ++i) {
      to[i] = static_cast<char>(data[i * element_bytes + b]);
    }
  }
  return bytes;
}

// HDF5's: of big-endian words, sums of at most 360 of which fit before they are reduced.
std::uint32_t fletcher32(std::string_view bytes) {
  constexpr std::size_t kMostWords = 360;
  const auto byte = [bytes](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i]));
  };
  const auto reduced = [](std::uint32_t sum) { return (sum & 0xffffU) + (sum >> 16); };
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  const std::size_t words = bytes.size() / 2;
  for (std::size_t begin = 0; begin < words; begin += kMostWords) {
    const std::size_t end = std::min(begin + kMostWords, words);
    for (std::size_t i = begin; i < end; ++i) {
      first += byte(2 * i) << 8 | byte(2 * i + 1);
      second += first;
    }
    first = reduced(first);
    second = reduced(second);
  }
  if (bytes.size() % 2 != 0) {
    first = reduced(first + (byte(bytes.size() - 1) << 8));
    second = reduced(second + first);
  }
  return reduced(second) << 16 | reduced(first);
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
  const std::uint32_t checksum = fletcher32(chunk.bytes);
  for (unsigned shift = 0; shift < 32; shift += 8) {
    chunk.bytes += static_cast<char>(checksum >> shift & 0xffU);
  }
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

}  // namespace weft::storage::h5
