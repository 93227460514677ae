#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <span>
#include <string>
#include <vector>

// HDF5, as far as fabric databases need it: the only file pair that knows the library. Files are
// made in memory and are the same bytes for the same calls; files are read with limits and nothing
// in them is followed out of them. The library is not safe for threads: whoever holds a writer or a
// reader holds its lock, others wait.

namespace weft::storage::h5 {

using Id = std::int64_t;  // hid_t

// Owns one HDF5 identifier of any kind.
class Handle {
 public:
  Handle() = default;
  explicit Handle(Id id) : id_(id) {}
  ~Handle();
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  Handle(Handle&& other) noexcept;
  Handle& operator=(Handle&& other) noexcept;
  [[nodiscard]] Id id() const { return id_; }

 private:
  Id id_ = -1;
};

// What the elements of a dataset are; all little-endian. kText is text of fixed length, UTF-8,
// padded with zeros.
enum class Element : std::uint8_t { kU16, kU32, kU64, kI32, kF16, kF32, kF64, kText };
[[nodiscard]] const char* to_string(Element element);

using Shape = std::vector<std::uint64_t>;
[[nodiscard]] std::string to_string(const Shape& shape);

// What a person who opens the file reads beside a dataset.
struct Caption {
  std::string units;
  std::string axes;
  std::string description;
};

// The library's lock, held for as long as the object lives; the library prints nothing meanwhile.
class Session {
 public:
  Session();

 private:
  std::unique_lock<std::recursive_mutex> lock_;
};

// Makes a file in memory. Groups and datasets appear in the order they are added. Throws
// core::Error(kResourceExhausted) naming the dataset when memory runs out.
class ImageWriter {
 public:
  // REQUIRES: user_block_bytes is 512 or a higher power of two.
  explicit ImageWriter(std::uint64_t user_block_bytes);

  void add_group(const std::string& path, const std::string& description);
  // Chunked, checksummed (Fletcher32), and shuffled and deflated where `compress`.
  // REQUIRES: no extent is 0 and `data` fills the shape; the group of `path` exists.
  void add_array(const std::string& path, Element element, const Shape& shape,
                 std::span<const std::byte> data, bool compress, const Caption& caption);
  void add_text(const std::string& path, const std::vector<std::string>& texts,
                const Caption& caption);
  void add_attribute(const std::string& path, const std::string& name, const std::string& value);
  void add_attribute(const std::string& path, const std::string& name, double value);
  // Makes the one-dimensional dataset `scale` the scale of an axis of dataset `path`.
  void attach_scale(const std::string& path, unsigned axis, const std::string& scale);
  // The whole file, its user block zeroed. The writer is spent.
  [[nodiscard]] std::string finish();

 private:
  [[nodiscard]] Handle open(const std::string& path) const;

  Session session_;
  std::uint64_t user_block_bytes_;
  Handle file_;
};

// Reads a file that may be hostile: refuses links out of the file, external and virtual storage,
// foreign filters, and shapes that the file is too small to hold. Throws core::Error(kDataLoss)
// naming the dataset, kNotFound when the file cannot be opened, kResourceExhausted when everything
// asked for so far exceeds kReadLimitBytes.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& path);

  struct Info {
    Element element = Element::kF32;
    Shape shape;
    std::uint64_t element_bytes = 0;  // of kText: the fixed length
    std::uint64_t stored_bytes = 0;   // after compression
  };
  [[nodiscard]] Info info(const std::string& path) const;
  // Counts a dataset against the limits, before memory is taken for it.
  void admit(const std::string& path, const Info& info);
  // REQUIRES: `info` is this dataset's and admitted, `out` has the size its shape needs.
  void read(const std::string& path, const Info& info, std::span<std::byte> out) const;
  [[nodiscard]] std::vector<std::string> read_text(const std::string& path);
  // Where the dataset's chunks are stored: offsets behind the user block.
  struct Extent {
    std::uint64_t offset = 0;
    std::uint64_t size_bytes = 0;
  };
  [[nodiscard]] std::vector<Extent> chunks(const std::string& path) const;
  [[nodiscard]] std::uint64_t file_bytes() const { return file_bytes_; }

 private:
  [[nodiscard]] Handle open(const std::string& path) const;

  Session session_;
  std::uint64_t file_bytes_ = 0;
  std::uint64_t decoded_bytes_ = 0;
  std::uint64_t claimed_bytes_ = 0;
  Handle file_;
};

inline constexpr std::uint64_t kReadLimitBytes = std::uint64_t{8} << 30;

}  // namespace weft::storage::h5
