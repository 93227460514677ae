#pragma once

#include <cstdint>

namespace weft::core {

// What has been used so far, for people to read; never part of a result.
[[nodiscard]] double thread_cpu_seconds();         // by the calling thread and its helpers
[[nodiscard]] double process_cpu_seconds();        // by all threads of this process
[[nodiscard]] std::uint64_t process_peak_bytes();  // the most memory that was resident at a time

// What helpers of the calling thread have used (core/parallel.h).
void add_thread_cpu_seconds(double helpers_seconds);

}  // namespace weft::core
