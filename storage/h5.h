#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <span>
#include <string>
#include <vector>

// HDF5, as far as fabric databases need it: the files storage/h5*.cpp alone know the library. Files
// are made in memory and are the same bytes for the same calls; files are read with limits and
// nothing in them is followed out of them (storage/h5_reader.h). The library is not safe for
// threads: whoever holds a writer or a reader holds its lock, others wait.

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

}  // namespace weft::storage::h5
