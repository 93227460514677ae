#pragma once

#include <functional>

namespace weft::transport {

// Called every few hundred milliseconds of long work. It may throw (a task was cancelled), which
// ends the work; an empty one is never called.
using Checkpoint = std::function<void()>;

inline void pass(const Checkpoint& checkpoint) {
  if (checkpoint) {
    checkpoint();
  }
}

}  // namespace weft::transport
