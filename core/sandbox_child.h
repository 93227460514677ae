#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/flat.h"

// The child's half of core/sandbox.h: what main of weft-open calls.

namespace weft::core {

// How one kind of file is parsed.
struct SandboxHandler {
  // Wakes libraries while everything is still allowed; sees nothing of the file.
  std::function<void()> prepare;
  // Parses `file` with the arguments of the request and writes the answer. What it throws goes back
  // to who asked.
  std::function<void(std::span<const std::byte> file, const std::vector<std::string>& arguments,
                     FlatWriter& answer)>
      parse;
};

// Confines this process for good, parses and ends. `arguments` are main's. Returns the exit code
// when it was not called by read_in_sandbox.
int serve_sandbox(int argc, char** argv, const std::map<std::string, SandboxHandler>& handlers);

namespace sandbox {

// What both halves know. The child's descriptors: the file, and where the answer goes.
inline constexpr int kInput = 3;
inline constexpr int kAnswer = 4;
// The first number of an answer: done, or an error's code plus 1 with its text after it.
inline constexpr std::uint64_t kDone = 0;
inline constexpr int kExitWrongUse = 2;
// arguments: kind, memory, answer, CPU seconds, filter ("confined" or "unsafe"), the rest.
inline constexpr int kFixedArguments = 6;
inline constexpr const char* kConfined = "confined";
inline constexpr const char* kUnsafe = "unsafe";

}  // namespace sandbox

}  // namespace weft::core
