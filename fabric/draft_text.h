#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace weft::fabric {

// What the readers of drafts in text share.

// Without the blanks (and zero bytes, which some programs leave) at both ends.
[[nodiscard]] std::string_view trimmed(std::string_view text);
[[nodiscard]] bool is_blank(char c);

// UTF-16 with a byte order mark as Latin text; anything else as it is, without UTF-8's mark.
[[nodiscard]] std::string plain_text(std::string_view text, bool& was_utf16);

// Calls visit(line, number) for every line, trimmed, from number 1 on; CR, LF and CRLF end one.
template <class Visit>
void for_each_line(std::string_view text, const Visit& visit) {
  std::uint32_t number = 0;
  for (std::size_t at = 0; at < text.size();) {
    std::size_t end = text.find_first_of("\r\n", at);
    end = end == std::string_view::npos ? text.size() : end;
    visit(trimmed(text.substr(at, end - at)), ++number);
    at = end + (text.compare(end, 2, "\r\n") == 0 ? 2 : 1);
  }
}

// All of the text as a number; nothing when it is none.
template <class T>
[[nodiscard]] std::optional<T> parsed(std::string_view text) {
  if (text.starts_with('+')) {
    text.remove_prefix(1);
  }
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return value;
}

// "3 ends".
[[nodiscard]] std::string number_of(std::size_t count, const std::string& thing);

}  // namespace weft::fabric
