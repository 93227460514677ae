#include "cli/message_json.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "cli/present.h"
#include "core/check.h"

namespace weft::cli {

namespace {

using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

std::string hex(const std::string& bytes) {
  std::string digits;
  for (const char byte : bytes) {
    digits += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  }
  return digits;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// JOB_STATE_QUEUED of JobState -> "queued".
std::string enum_text(const EnumValueDescriptor& value) {
  std::string prefix;
  for (const char c : value.type()->name()) {
    prefix += std::isupper(static_cast<unsigned char>(c)) != 0 && !prefix.empty() ? "_" : "";
    prefix += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  prefix += "_";
  const std::string& name = value.name();
  return lower(name.starts_with(prefix) ? name.substr(prefix.size()) : name);
}

bool is_time(const FieldDescriptor& field) {
  return field.cpp_type() == FieldDescriptor::CPPTYPE_INT64 && field.name().ends_with("_at_ms");
}

nlohmann::json time_json(std::int64_t at_ms) {
  if (at_ms <= 0) {
    return nullptr;
  }
  std::string text = time_text(at_ms);
  text[text.find(' ')] = 'T';
  return fmt::format("{}.{:03}Z", text, at_ms % 1000);
}

nlohmann::json scalar(const Message& message, const FieldDescriptor& field) {
  const Reflection& values = *message.GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return values.GetInt32(message, &field);
    case FieldDescriptor::CPPTYPE_INT64:
      return is_time(field) ? time_json(values.GetInt64(message, &field))
                            : nlohmann::json(values.GetInt64(message, &field));
    case FieldDescriptor::CPPTYPE_UINT32:
      return values.GetUInt32(message, &field);
    case FieldDescriptor::CPPTYPE_UINT64:
      return values.GetUInt64(message, &field);
    case FieldDescriptor::CPPTYPE_DOUBLE: {
      const double value = values.GetDouble(message, &field);
      const bool is_unknown = field.name() == "seconds_left" && value < 0;
      return is_unknown ? nlohmann::json(nullptr) : nlohmann::json(value);
    }
    case FieldDescriptor::CPPTYPE_FLOAT:
      return values.GetFloat(message, &field);
    case FieldDescriptor::CPPTYPE_BOOL:
      return values.GetBool(message, &field);
    case FieldDescriptor::CPPTYPE_ENUM:
      return enum_text(*values.GetEnum(message, &field));
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string value = values.GetString(message, &field);
      return field.type() == FieldDescriptor::TYPE_BYTES ? hex(value) : value;
    }
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return values.HasField(message, &field) ? to_json(values.GetMessage(message, &field))
                                              : nlohmann::json(nullptr);
  }
  core::check_failed(__FILE__, __LINE__, "unknown type of field");
}

// Of repeated fields only texts and messages are shown: there are no others.
nlohmann::json list(const Message& message, const FieldDescriptor& field) {
  const Reflection& values = *message.GetReflection();
  nlohmann::json array = nlohmann::json::array();
  for (int i = 0; i < values.FieldSize(message, &field); ++i) {
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      array.push_back(to_json(values.GetRepeatedMessage(message, &field, i)));
    } else if (field.type() == FieldDescriptor::TYPE_BYTES) {
      array.push_back(hex(values.GetRepeatedString(message, &field, i)));
    } else {
      CHECK(field.cpp_type() == FieldDescriptor::CPPTYPE_STRING);
      array.push_back(values.GetRepeatedString(message, &field, i));
    }
  }
  return array;
}

}  // namespace

nlohmann::json to_json(const Message& message) {
  nlohmann::json json = nlohmann::json::object();
  const auto& type = *message.GetDescriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    if (field.is_repeated()) {
      json[field.name()] = list(message, field);
    } else if (field.message_type() == v1::AttemptName::descriptor() && field.name() == "name") {
      json.update(scalar(message, field));
    } else if (is_time(field)) {
      json[field.name().substr(0, field.name().size() - 3)] = scalar(message, field);
    } else {
      json[field.name()] = scalar(message, field);
    }
  }
  if (&type == v1::Version::descriptor()) {
    json["reference"] = reference_text(static_cast<const v1::Version&>(message));
  }
  return json;
}

}  // namespace weft::cli
