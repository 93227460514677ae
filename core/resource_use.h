#pragma once

#include <cstdint>

namespace weft::core {

// What has been used so far, for people to read; never part of a result.
[[nodiscard]] double thread_cpu_seconds();         // by the calling thread
[[nodiscard]] double process_cpu_seconds();        // by all threads of this process
[[nodiscard]] std::uint64_t process_peak_bytes();  // the most memory that was resident at a time

}  // namespace weft::core
