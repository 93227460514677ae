#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "proto/document.h"

namespace weft::v1 {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using nlohmann::json;

// "line:column", from 1, of a byte.
std::string line_and_column(std::string_view text, std::size_t byte) {
  std::size_t line = 1;
  std::size_t column = 1;
  for (std::size_t i = 0; i + 1 < byte && i < text.size(); ++i) {
    column = text[i] == '\n' ? 1 : column + 1;
    line += text[i] == '\n' ? 1U : 0U;
  }
  return std::to_string(line) + ":" + std::to_string(column);
}

const FieldDescriptor* field_called(const Descriptor& type, const std::string& key) {
  const FieldDescriptor* field = type.FindFieldByName(key);
  return field != nullptr ? field : type.FindFieldByCamelcaseName(key);
}

bool is_integer(const json& value, double least, double most) {
  if (!value.is_number()) {
    return false;
  }
  const double number = value.get<double>();
  return number >= least && number <= most && number == std::trunc(number);
}

std::string enum_names(const FieldDescriptor& field) {
  std::string list;
  for (int v = 1; v < field.enum_type()->value_count(); ++v) {
    list.append(v == 1 ? "one of " : ", ").append(field.enum_type()->value(v)->name());
  }
  return list;
}

// What a single value of this field must be, when `value` is not that; empty when it is.
std::string wanted(const FieldDescriptor& field, const json& value) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return value.is_object() ? "" : "an object in braces";
    case FieldDescriptor::CPPTYPE_STRING:
      return value.is_string() ? "" : "a text in quotes";
    case FieldDescriptor::CPPTYPE_BOOL:
      return value.is_boolean() ? "" : "true or false";
    case FieldDescriptor::CPPTYPE_DOUBLE:
    case FieldDescriptor::CPPTYPE_FLOAT:
      return value.is_number() || value == "NaN" || value == "Infinity" || value == "-Infinity"
                 ? ""
                 : "a number";
    case FieldDescriptor::CPPTYPE_INT32:
      return is_integer(value, std::numeric_limits<std::int32_t>::min(),
                        std::numeric_limits<std::int32_t>::max())
                 ? ""
                 : "a whole number";
    case FieldDescriptor::CPPTYPE_ENUM:
      return value.is_string() &&
                     field.enum_type()->FindValueByName(value.get<std::string>()) != nullptr
                 ? ""
                 : enum_names(field);
    case FieldDescriptor::CPPTYPE_UINT32:
      return is_integer(value, 0, std::numeric_limits<std::uint32_t>::max())
                 ? ""
                 : "a whole number from 0 to 4294967295";
    default:
      return value.is_number_unsigned() || value.is_string() ? "" : "a whole number from 0 on";
  }
}

// Takes out of `value` what is no field of `type` or not of its field's kind, and lists it.
void clean(const Descriptor& type, const std::string& path, json& value, core::Mistakes& mistakes);

bool clean_value(const FieldDescriptor& field, const std::string& path, json& value,
                 core::Mistakes& mistakes) {
  const std::string right = wanted(field, value);
  if (!right.empty()) {
    mistakes.push_back(
        {path, core::in_quotes(value.is_string() ? value.get<std::string>() : value.dump()) +
                   " does not fit; " + right + " is needed"});
    return false;
  }
  if (field.message_type() != nullptr) {
    clean(*field.message_type(), path, value, mistakes);
  }
  return true;
}

void clean(const Descriptor& type, const std::string& path, json& value, core::Mistakes& mistakes) {
  json kept = json::object();
  for (const auto& [key, member] : value.items()) {
    std::string here = path;
    here.append(path.empty() ? "" : ".").append(key);
    const FieldDescriptor* field = field_called(type, key);
    if (field == nullptr) {
      std::vector<std::string> known;
      known.reserve(static_cast<std::size_t>(type.field_count()));
      for (int f = 0; f < type.field_count(); ++f) {
        known.push_back(type.field(f)->name());
      }
      mistakes.push_back({here, core::in_quotes(key) + " is no field of " + type.name() +
                                    core::suggestion(key, known)});
      continue;
    }
    std::string named = path;
    named.append(path.empty() ? "" : ".").append(field->name());
    if (member.is_null()) {
      continue;
    }
    if (!field->is_repeated()) {
      if (clean_value(*field, named, member, mistakes)) {
        kept[field->name()] = std::move(member);
      }
      continue;
    }
    if (!member.is_array()) {
      mistakes.push_back({named, "this is a list; write it in brackets, [ ]"});
      continue;
    }
    for (std::size_t i = 0; i < member.size(); ++i) {
      const std::string item = named + "[" + std::to_string(i) + "]";
      if (!clean_value(*field, item, member[i], mistakes)) {
        // Something of the right kind stands in, so that the numbers of the others stay right.
        member[i] = field->message_type() != nullptr                       ? json::object()
                    : field->cpp_type() == FieldDescriptor::CPPTYPE_STRING ? json("")
                                                                           : json(0);
      }
    }
    kept[field->name()] = std::move(member);
  }
  value = std::move(kept);
}

// Whether brackets are nested deeper than any message of ours needs: parsing it would be safe, but
// not everything that is done with a value afterwards.
bool too_deep(std::string_view text) {
  constexpr int kDeepest = 32;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      i += c == '\\' ? 1U : 0U;
      in_string = c != '"';
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      if (++depth > kDeepest) {
        return true;
      }
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return false;
}

class JsonDocument : public Document {
 public:
  JsonDocument(std::string_view text, std::string name, google::protobuf::Message& message)
      : name_(std::move(name)) {
    message.Clear();
    json value;
    if (too_deep(text)) {
      listing_ = name_ + ": brackets are nested deeper than 32; no description needs that";
      unreadable_ = true;
      return;
    }
    try {
      value = json::parse(text);
    } catch (const json::parse_error& error) {
      std::string what = error.what();
      what = what.substr(std::min(what.find("syntax error"), what.size()));
      listing_ = name_ + ":" + line_and_column(text, error.byte) + ": " +
                 (what.empty() ? "this is no JSON" : what);
      unreadable_ = true;
      return;
    } catch (const json::exception&) {
      listing_ = name_ + ": a number is too large";
      unreadable_ = true;
      return;
    }
    if (!value.is_object()) {
      listing_ = name_ + ": a description is an object in braces, { }";
      unreadable_ = true;
      return;
    }
    core::Mistakes mistakes;
    clean(*message.GetDescriptor(), "", value, mistakes);
    const auto status = google::protobuf::util::JsonStringToMessage(value.dump(), &message);
    if (!status.ok()) {
      mistakes.push_back({"", status.message().as_string()});
      unreadable_ = true;
    }
    for (const core::Mistake& mistake : mistakes) {
      add(listing_, mistake);
    }
  }

  [[nodiscard]] bool names_fields() const override { return true; }

  [[nodiscard]] std::string listing(const core::Mistakes& further) const override {
    std::string lines = listing_;
    for (const core::Mistake& mistake : further) {
      add(lines, mistake);
    }
    return lines;
  }

 private:
  void add(std::string& lines, const core::Mistake& mistake) const {
    lines.append(lines.empty() ? "" : "\n").append(name_).append(": ");
    lines.append(mistake.path).append(mistake.path.empty() ? "" : ": ").append(mistake.message);
  }

  std::string name_;
  std::string listing_;
};

}  // namespace

std::unique_ptr<Document> read_json(std::string_view text, const std::string& name,
                                    google::protobuf::Message& message) {
  return std::make_unique<JsonDocument>(text, name, message);
}

}  // namespace weft::v1
