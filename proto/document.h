#pragma once

#include <string>
#include <string_view>

#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>

namespace weft::v1 {

// A message that a person wrote, and where in the file each field of it stands, so that every
// mistake can be reported at its place: "file:line:column: what is wrong" for protobuf text,
// "file: lights[0].sg.sharpness: what is wrong" for JSON.
class Document {
 public:
  // Parses `text` into `message`, which is cleared first: JSON when `name` ends in .json, else
  // protobuf text. `name` stands for the file in messages. Throws core::Error(kInvalidArgument)
  // when the text is neither, has unknown fields or numbers that are not finite; the message says
  // where, and which fields there are.
  Document(std::string_view text, std::string name, google::protobuf::Message& message);

  // Notes a mistake at a field, named by its path: "lights[0].sg.sharpness". A field that is not
  // set is reported where the message around it begins. `what` says what is wrong, then what would
  // be right.
  void complain(const std::string& path, const std::string& what);

  // Throws core::Error(kInvalidArgument) with all mistakes noted so far, one per line, if any.
  void throw_if_wrong() const;

 private:
  [[nodiscard]] std::string place(const std::string& path) const;
  void refuse_non_finite(const google::protobuf::Message& message, const std::string& path);

  std::string name_;
  bool is_json_;
  const google::protobuf::Descriptor* descriptor_;
  google::protobuf::TextFormat::ParseInfoTree places_;
  std::string mistakes_;
};

}  // namespace weft::v1
