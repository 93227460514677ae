#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/input_file.h"

// Files from strangers are parsed by a small program of its own, weft-open, that lies beside the
// running program. It gets the file as a descriptor and nothing else: it cannot open another file,
// reach the network or start a program, and its memory, time and answer are limited. What it hands
// back is data to be checked, in the form of core/flat.h. A library that is led astray by a file
// harms nobody but this child.

namespace weft::core {

struct SandboxLimits {
  std::uint64_t memory_bytes = 0;  // of address space, beside the program itself
  std::uint64_t answer_bytes = 0;
  std::uint64_t cpu_s = 0;
};

// What the child handed back, in memory that nobody else can change any more.
class SandboxAnswer {
 public:
  SandboxAnswer(const void* data, std::size_t size) : data_(data), size_(size) {}
  ~SandboxAnswer();
  SandboxAnswer(const SandboxAnswer&) = delete;
  SandboxAnswer& operator=(const SandboxAnswer&) = delete;
  SandboxAnswer(SandboxAnswer&& other) noexcept;
  SandboxAnswer& operator=(SandboxAnswer&&) = delete;
  // Aligned to 8 bytes.
  [[nodiscard]] std::span<const std::byte> bytes() const {
    return all().subspan(sizeof(outcome()));
  }
  // How it went (core/sandbox_child.h). REQUIRES: it has at least 8 bytes.
  [[nodiscard]] std::uint64_t outcome() const;

 private:
  [[nodiscard]] std::span<const std::byte> all() const {
    return {static_cast<const std::byte*>(data_), size_};
  }

  const void* data_;
  std::size_t size_;
};

// Has weft-open parse `file`; `request` is the kind of file and what is asked of it
// (core/sandbox_child.h). Any thread may call; it waits. Throws what the child throws, and
// core::Error: kDataLoss when the child crashed or tried what it may not, kResourceExhausted when
// it needed more than its limits, kUnavailable when weft-open is missing or cannot be
// confined here. WEFT_UNSAFE_OPEN=1 in the environment does without the kernel's filter where there
// is none; the limits and the process of its own remain. `program` lies beside the running one.
[[nodiscard]] SandboxAnswer read_in_sandbox(const InputFile& file,
                                            const std::vector<std::string>& request,
                                            const SandboxLimits& limits,
                                            const char* program = "weft-open");

// The folder of the running program. Throws core::Error(kUnavailable).
[[nodiscard]] std::filesystem::path folder_of_this_program();

}  // namespace weft::core
