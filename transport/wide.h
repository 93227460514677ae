#pragma once

namespace weft::transport {

// Whether kernels may take their wide path: the processor and the system have AVX-512 (F, BW, DQ,
// VL), and the environment does not say WEFT_PORTABLE=1. Wide and portable paths give the same
// bits, so the answer changes nothing but the time; tests run both. Reads the environment: ask once
// for an object or a batch, not in a loop. Any thread may call.
[[nodiscard]] bool wide_is_available();

}  // namespace weft::transport

// Stands before functions that use AVX-512 intrinsics. An attribute for each function, and not
// options for a whole file, whose copies of inline functions other files would then run, too.
// Lambdas do not inherit it. Only what wide_is_available() has let in may call such functions.
// GCC 12 warns inside its own header of intrinsics that start from undefined registers (sqrt, min,
// max, shifts): their maskz forms with a full mask do the same without.
#define WEFT_WIDE [[gnu::target("avx512f,avx512bw,avx512dq,avx512vl")]]
