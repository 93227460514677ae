#include "proto/document.h"

#include <filesystem>

namespace weft::v1 {
namespace {

bool is_json(const std::string& name, std::string_view text) {
  const std::string ending = std::filesystem::path(name).extension().string();
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return ending == ".json" ||
         (ending.empty() && first != std::string_view::npos && text[first] == '{');
}

}  // namespace

std::unique_ptr<Document> read_document(std::string_view text, const std::string& name,
                                        google::protobuf::Message& message) {
  return is_json(name, text) ? read_json(text, name, message) : read_text(text, name, message);
}

}  // namespace weft::v1
