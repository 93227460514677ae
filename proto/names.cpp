#include "proto/names.h"

#include <algorithm>

#include "proto/limits.h"

namespace weft::v1 {

namespace {

constexpr std::size_t kJobIdLength = 13;

bool is_small(char c) { return c >= 'a' && c <= 'z'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter_or_digit(char c) { return is_small(c) || is_digit(c) || (c >= 'A' && c <= 'Z'); }
bool is_small_hexadecimal(char c) { return is_digit(c) || (c >= 'a' && c <= 'f'); }

// 1 to kIdLimit characters, each a letter or digit or one of `others`.
template <class Plain>
bool consists_of(std::string_view text, Plain is_plain, std::string_view others) {
  return !text.empty() && text.size() <= kIdLimit &&
         std::all_of(text.begin(), text.end(), [&](char c) {
           return is_plain(c) || others.find(c) != std::string_view::npos;
         });
}

bool is_small_or_digit(char c) { return is_small(c) || is_digit(c); }

// The bytes of one character of UTF-8, by its first byte; 0 when none begins so.
std::size_t length_of_character(unsigned char first) {
  if (first < 0x80) {
    return 1;
  }
  if (first >= 0xc2 && first < 0xe0) {
    return 2;
  }
  if (first >= 0xe0 && first < 0xf0) {
    return 3;
  }
  return first >= 0xf0 && first < 0xf5 ? 4 : 0;
}

bool is_readable_utf8(std::string_view text) {
  for (std::size_t at = 0; at < text.size();) {
    const auto first = static_cast<unsigned char>(text[at]);
    const std::size_t length = length_of_character(first);
    if (length == 0 || at + length > text.size() || first < 0x20 || first == 0x7f) {
      return false;
    }
    for (std::size_t i = 1; i < length; ++i) {
      if ((static_cast<unsigned char>(text[at + i]) & 0xc0U) != 0x80U) {
        return false;
      }
    }
    at += length;
  }
  return true;
}

}  // namespace

bool is_fabric_name(std::string_view text) {
  return consists_of(text, is_small_or_digit, "_-") && is_small_or_digit(text.front());
}

bool is_tag(std::string_view text) {
  return consists_of(text, is_small_or_digit, "_.-") && is_small_or_digit(text.front()) &&
         text != "latest" && !std::all_of(text.begin(), text.end(), is_digit);
}

bool is_id(std::string_view text) { return consists_of(text, is_letter_or_digit, "_-"); }

bool begins_job_id(std::string_view text) {
  return !text.empty() && text.size() <= kJobIdLength && text.front() == 'j' &&
         std::all_of(text.begin() + 1, text.end(), is_small_hexadecimal);
}

bool is_job_id(std::string_view text) { return text.size() == kJobIdLength && begins_job_id(text); }

bool is_user_name(std::string_view text) {
  return consists_of(text, is_letter_or_digit, "_.@-") && is_letter_or_digit(text.front());
}

bool is_label(std::string_view text) { return consists_of(text, is_letter_or_digit, "_.=-"); }

bool is_worker_name(std::string_view text) {
  return !text.empty() && text.size() <= kNameLimitBytes && is_readable_utf8(text);
}

}  // namespace weft::v1
