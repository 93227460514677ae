#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include <unistd.h>

namespace weft::fuzz {

// A new folder of this process alone, in memory where the machine has a place for it. Its owner
// removes it.
inline std::filesystem::path make_own_folder() {
  const std::filesystem::path memory = "/dev/shm";
  const bool has_memory = std::filesystem::is_directory(memory);
  const std::filesystem::path place = has_memory ? memory : std::filesystem::temp_directory_path();
  std::string name = (place / "weft_fuzz_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    std::abort();
  }
  return name;
}

}  // namespace weft::fuzz
