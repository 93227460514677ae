#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace weft::core {

// One thing that is wrong with a written message. `path` leads to the field, such as
// "yarns[1].hairs.per_mm"; empty means the message as a whole.
struct Mistake {
  std::string path;
  std::string message;  // what is wrong; what would be right
};

using Mistakes = std::vector<Mistake>;

// "; did you mean \"x\"?" with the known name nearest to `name`, or "; known are ..." when none is
// near, or "" when none is known. Of many names, the first dozen are listed.
[[nodiscard]] std::string suggestion(std::string_view name, const std::vector<std::string>& known);

// A text as it may be repeated in a message: in quotes, printable, at most 40 characters.
[[nodiscard]] std::string in_quotes(std::string_view text);

// A number with as few digits as tell it apart: 0.05, 20, nan.
[[nodiscard]] std::string shortest(double value);

}  // namespace weft::core
