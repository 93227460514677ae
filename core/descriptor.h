#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace weft::core {

// Throws Error(kUnavailable): "cannot <what> <path>: <errno in words>".
[[noreturn]] void throw_errno(const std::string& what, const std::filesystem::path& path);

// A file descriptor that closes itself, opened and written by the calls of core/file_fault.h.
class Descriptor {
 public:
  // As open(2). Throws Error(kUnavailable).
  Descriptor(const std::filesystem::path& path, int flags);
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  Descriptor(Descriptor&&) = delete;
  Descriptor& operator=(Descriptor&&) = delete;
  [[nodiscard]] int value() const { return value_; }

  // All of `data`; whether it was written, and errno if not.
  [[nodiscard]] bool write(std::string_view data) const;
  // Throws Error(kUnavailable).
  void sync() const;

 private:
  std::filesystem::path path_;
  int value_;
};

}  // namespace weft::core
