#pragma once

#include <cstddef>
#include <functional>

namespace weft::core {

inline constexpr unsigned kAllCores = 0;  // as many threads as the machine has cores

// Calls work(i) once for each i < count, in this thread and others, `most_threads` together. Their
// CPU time counts as this thread's (core/resource_use.h), and they compute in its float mode.
// Indices are dealt in their order, whatever thread takes them: what `work` writes must not
// depend on that. After a failure no more are dealt; the failure of the lowest index is thrown when
// all threads are done, which is the same one on any number of threads. Where the system gives no
// further threads, this one does all.
void in_parallel(std::size_t count, const std::function<void(std::size_t)>& work,
                 unsigned most_threads = kAllCores);

}  // namespace weft::core
