#include "coordinator/versions/description_changes.h"

#include <algorithm>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>

#include "core/check.h"

namespace weft::coordinator {

namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using google::protobuf::TextFormat;

constexpr std::size_t kTextLimitBytes = 200;
constexpr int kWhole = -1;  // index of a field that is no list

bool is_message(const FieldDescriptor& field) {
  return field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
}

std::string shortened(std::string text) {
  if (text.size() > kTextLimitBytes) {
    text.resize(kTextLimitBytes);
    text += "...";
  }
  return text;
}

const Message& part_of(const Message& message, const FieldDescriptor& field, int index) {
  const Reflection& values = *message.GetReflection();
  return index == kWhole ? values.GetMessage(message, &field)
                         : values.GetRepeatedMessage(message, &field, index);
}

std::string text_of(const Message& message, const FieldDescriptor& field, int index) {
  if (is_message(field)) {
    return shortened("{ " + part_of(message, field, index).ShortDebugString() + " }");
  }
  std::string text;
  TextFormat::PrintFieldValueToString(message, &field, index, &text);
  return shortened(std::move(text));
}

bool is_there(const Message& message, const FieldDescriptor& field) {
  // A number without presence is always there.
  return !field.has_presence() || message.GetReflection()->HasField(message, &field);
}

class Comparison {
 public:
  void compare(const Message& from, const Message& to, const std::string& prefix) {
    const Descriptor& type = *from.GetDescriptor();
    for (int i = 0; i < type.field_count(); ++i) {
      const FieldDescriptor& field = *type.field(i);
      const std::string path = prefix + (prefix.empty() ? "" : ".") + field.name();
      if (field.is_repeated()) {
        compare_lists(from, to, field, path);
      } else {
        compare_values(from, is_there(from, field), to, is_there(to, field), field, kWhole, path);
      }
    }
  }
  std::vector<FieldDifference> found;

 private:
  void compare_lists(const Message& from, const Message& to, const FieldDescriptor& field,
                     const std::string& path) {
    const int size_from = from.GetReflection()->FieldSize(from, &field);
    const int size_to = to.GetReflection()->FieldSize(to, &field);
    for (int i = 0; i < std::max(size_from, size_to); ++i) {
      compare_values(from, i < size_from, to, i < size_to, field, i,
                     path + "[" + std::to_string(i) + "]");
    }
  }

  void compare_values(const Message& from, bool in_from, const Message& to, bool in_to,
                      const FieldDescriptor& field, int index, const std::string& path) {
    if (found.size() >= kFieldDifferencesLimit || (!in_from && !in_to)) {
      return;
    }
    if (in_from && in_to && is_message(field)) {
      compare(part_of(from, field, index), part_of(to, field, index), path);
      return;
    }
    FieldDifference difference{path, in_from ? text_of(from, field, index) : "",
                               in_to ? text_of(to, field, index) : ""};
    if (in_from != in_to || difference.from != difference.to) {
      found.push_back(std::move(difference));
    }
  }
};

}  // namespace

std::vector<FieldDifference> differences_of(const Message& from, const Message& to) {
  CHECK(from.GetDescriptor() == to.GetDescriptor());
  Comparison comparison;
  comparison.compare(from, to, "");
  return std::move(comparison.found);
}

}  // namespace weft::coordinator
