#include "storage/user_block.h"

#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

#include "core/check.h"
#include "core/error.h"

namespace weft::storage {

namespace {

constexpr std::string_view kTitle = "weft fabric database\n";

// Takes "<key> <value>\n" off the front of `text`; nothing when it is not there.
std::optional<std::string_view> take_line(std::string_view& text, std::string_view key) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos || !text.starts_with(key) || end <= key.size()) {
    return std::nullopt;
  }
  const std::string_view value = text.substr(key.size(), end - key.size());
  text.remove_prefix(end + 1);
  return value;
}

template <class Number>
std::optional<Number> number_in(std::optional<std::string_view> text) {
  Number value = 0;
  if (!text) {
    return std::nullopt;
  }
  const auto [end, failure] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (failure != std::errc() || end != text->data() + text->size()) {
    return std::nullopt;
  }
  return value;
}

}  // namespace

std::string encode_user_block(const UserBlock& block) {
  std::string text(kTitle);
  text += "schema " + std::to_string(block.schema) + "\n";
  text += "bytes " + std::to_string(block.file_bytes) + "\n";
  text += "sha256 " + block.digest.hex() + "\n";
  CHECK_LT(text.size(), kUserBlockBytes);
  text.resize(kUserBlockBytes, '\0');
  return text;
}

UserBlock parse_user_block(std::string_view bytes, std::uint64_t file_bytes,
                           const std::string& name) {
  std::string_view rest = bytes;
  if (!rest.starts_with(kTitle)) {
    throw core::Error(core::Code::kDataLoss,
                      name +
                          " is not a fabric database, or its first bytes are damaged; make one "
                          "with weft run or weft fetch");
  }
  rest.remove_prefix(kTitle.size());
  const auto schema = number_in<std::uint32_t>(take_line(rest, "schema "));
  const auto stated_bytes = number_in<std::uint64_t>(take_line(rest, "bytes "));
  const auto hex = take_line(rest, "sha256 ");
  const auto digest = hex ? core::Digest::from_hex(*hex) : std::nullopt;
  if (!schema || !stated_bytes || !digest ||
      encode_user_block({*schema, *stated_bytes, *digest}) != bytes) {
    throw core::Error(core::Code::kDataLoss, name +
                                                 " is damaged: its first 512 bytes are not as "
                                                 "written; fetch or make it again");
  }
  if (*schema != kDatabaseSchema) {
    throw core::Error(core::Code::kFailedPrecondition,
                      name + " has schema " + std::to_string(*schema) +
                          "; this program reads schema " + std::to_string(kDatabaseSchema) +
                          ": use a newer weft");
  }
  if (*stated_bytes != file_bytes) {
    throw core::Error(core::Code::kDataLoss,
                      name + " is damaged: it has " + std::to_string(file_bytes) +
                          " bytes and was written with " + std::to_string(*stated_bytes) +
                          "; fetch or make it again");
  }
  return {*schema, *stated_bytes, *digest};
}

}  // namespace weft::storage
