#include "core/mistakes.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

namespace weft::core {
namespace {

// Levenshtein's distance.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) {
    row[j] = j;
  }
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replace = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replace, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

std::string suggestion(std::string_view name, const std::vector<std::string>& known) {
  constexpr std::size_t kLongestName = 64;
  const std::string* nearest = nullptr;
  std::size_t least = std::min(name.size(), kLongestName) / 3 + 2;
  for (const std::string& candidate : known) {
    if (!name.empty() && name.size() <= kLongestName && edit_distance(name, candidate) < least) {
      least = edit_distance(name, candidate);
      nearest = &candidate;
    }
  }
  if (nearest != nullptr) {
    return "; did you mean " + in_quotes(*nearest) + "?";
  }
  constexpr std::size_t kMost = 12;
  std::string list;
  for (std::size_t i = 0; i < std::min(known.size(), kMost); ++i) {
    list.append(i == 0 ? "; known are " : ", ").append(known[i]);
  }
  return list + (known.size() > kMost ? ", ..." : "");
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kMost = 40;
  std::string result = "\"";
  for (const char c : text.substr(0, kMost)) {
    result += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  return result + (text.size() > kMost ? "...\"" : "\"");
}

std::string shortest(double value) {
  std::array<char, 40> digits{};
  (void)std::snprintf(digits.data(), digits.size(), "%.6g", value);
  if (std::strtod(digits.data(), nullptr) != value && value == value) {
    (void)std::snprintf(digits.data(), digits.size(), "%.17g", value);
  }
  return digits.data();
}

}  // namespace weft::core
