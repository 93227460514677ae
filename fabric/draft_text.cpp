#include "fabric/draft_text.h"

namespace weft::fabric {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\f' || c == '\v' || c == '\0'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) {
    text.remove_prefix(1);
  }
  while (!text.empty() && is_blank(text.back())) {
    text.remove_suffix(1);
  }
  return text;
}

std::string plain_text(std::string_view text, bool& was_utf16) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  was_utf16 = text.size() >= 2 &&
              ((byte(0) == 0xff && byte(1) == 0xfe) || (byte(0) == 0xfe && byte(1) == 0xff));
  if (!was_utf16) {
    constexpr std::string_view kMark = "\xef\xbb\xbf";
    return std::string(text.starts_with(kMark) ? text.substr(kMark.size()) : text);
  }
  const std::size_t low = byte(0) == 0xff ? 0 : 1;
  std::string result;
  result.reserve(text.size() / 2);
  for (std::size_t i = 2; i + 1 < text.size(); i += 2) {
    const char c = text[i + low];
    result += byte(i + 1 - low) == 0 && byte(i + low) < 0x80 ? c : '?';
  }
  return result;
}

std::string number_of(std::size_t count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

}  // namespace weft::fabric
