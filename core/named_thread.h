#pragma once

#include <functional>
#include <thread>

namespace weft::core {

// A thread that `top -H` and /proc call `name`, as they do those that it starts: of at most 15
// characters.
[[nodiscard]] std::thread named_thread(const char* name, std::function<void()> work);

}  // namespace weft::core
