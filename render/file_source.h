#pragma once

#include <functional>
#include <string>

namespace weft::render {

// Gives the bytes of a file that a scene names: a mesh, an environment, a pattern. Throws
// core::Error(kNotFound) when there is none, kResourceExhausted when it is too large.
using FileSource = std::function<std::string(const std::string& name)>;

// Names are paths on this machine's disk.
[[nodiscard]] FileSource files_on_disk();

}  // namespace weft::render
