#pragma once

namespace weft::core {

// Of the whole project, as in "0.1.0".
[[nodiscard]] const char* version();

}  // namespace weft::core
