#pragma once

namespace weft::bench {

// What one thread of this machine can do at best, measured: figures of kernels are set against it.
struct MachineLimits {
  double read_bytes_per_s = 0;     // out of memory, in order
  double multiply_adds_per_s = 0;  // fused ones of single precision, by the widest registers
};

// The best of some repetitions, half a second in all; measured at the first call.
[[nodiscard]] const MachineLimits& machine_limits();

}  // namespace weft::bench
