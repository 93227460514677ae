#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>

// What libFuzzer calls, and what the corpus test calls without it: each <name>_fuzz.cpp has one.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace weft::fuzz {

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

// Runs a parser that the programs run in their sandbox alone (core/sandbox.h) in a process of its
// own, too: a library that crashes there, or uses memory of its own wrongly, is counted, not a
// finding. An exception other than core::Error, a CHECK of ours, or what a sanitizer finds in our
// code or in memory of ours is one: it aborts.
void run_apart(const std::function<void()>& parse);

}  // namespace weft::fuzz
