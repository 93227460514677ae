#pragma once

#include <string_view>

namespace weft::fuzz {

// Whether what AddressSanitizer reports happened inside a library: one of its functions made the
// access, and all memory that the report tells of was taken, and given back, by libraries. Code of
// the program itself is known by the source lines in its frames, which `program` is built with; in
// doubt the answer is no. `program` is the path that its frames name.
[[nodiscard]] bool is_in_library(std::string_view report, std::string_view program);

}  // namespace weft::fuzz
