#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <google/protobuf/message.h>

#include "core/mistakes.h"

namespace weft::v1 {

// A message that a person wrote: what was wrong with the writing, and where in the file each field
// stands, so that every mistake can be reported at its place.
class Document {
 public:
  Document() = default;
  Document(const Document&) = delete;
  Document& operator=(const Document&) = delete;
  Document(Document&&) = delete;
  Document& operator=(Document&&) = delete;
  virtual ~Document() = default;

  // True when nothing of the message can be relied on: mistakes of meaning are not worth listing.
  [[nodiscard]] bool unreadable() const { return unreadable_; }

  // Whether places are the paths of fields rather than lines and columns.
  [[nodiscard]] virtual bool names_fields() const = 0;

  // All mistakes, those of writing and `further` ones, one per line in the order of the file, each
  // with its place. A field that is not written stands where the message round it begins. Empty
  // when there are none.
  [[nodiscard]] virtual std::string listing(const core::Mistakes& further) const = 0;

 protected:
  bool unreadable_ = false;
};

// Parses `text` into `message`, which is cleared first: JSON when `name` ends in .json, or has no
// ending and the text begins with a brace, else protobuf text. `name` stands for the file in
// messages. Never throws for what the text holds: ask the document.
[[nodiscard]] std::unique_ptr<Document> read_document(std::string_view text,
                                                      const std::string& name,
                                                      google::protobuf::Message& message);

// Protobuf text format: places are "name:line:column". Unknown fields are mistakes and are skipped.
[[nodiscard]] std::unique_ptr<Document> read_text(std::string_view text, const std::string& name,
                                                  google::protobuf::Message& message);

// JSON: places are "name: field.path", or "name:line:column" where the text is no JSON at all.
// Unknown fields and values of the wrong kind are mistakes and are skipped.
[[nodiscard]] std::unique_ptr<Document> read_json(std::string_view text, const std::string& name,
                                                  google::protobuf::Message& message);

}  // namespace weft::v1
