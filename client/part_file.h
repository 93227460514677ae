#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace weft::client {

// A file that is being fetched, held by this process alone. One thread. Everything throws
// core::Error(kUnavailable) naming the file when it cannot be read or written.
class PartFile {
 public:
  // Opens or makes the file; waits while another process holds it.
  explicit PartFile(std::filesystem::path path);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;
  PartFile(PartFile&&) = delete;
  PartFile& operator=(PartFile&&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::uint64_t size_bytes() const;
  // Keeps the first bytes. REQUIRES: there are so many.
  void shorten(std::uint64_t size_bytes);
  void append(std::string_view data);

 private:
  std::filesystem::path path_;
  int file_ = -1;
};

}  // namespace weft::client
