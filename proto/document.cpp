#include "proto/document.h"

#include <charconv>
#include <cmath>
#include <utility>
#include <vector>

#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/util/json_util.h>

#include "core/error.h"

namespace weft::v1 {
namespace {

namespace pb = google::protobuf;

std::string fields_of(const pb::Descriptor& type) {
  std::string names;
  for (int i = 0; i < type.field_count(); ++i) {
    if (i > 0) {
      names += ", ";
    }
    names += type.field(i)->name();
  }
  return names;
}

// Protobuf says which message has no such field; we add which fields it has.
std::string with_known_fields(const std::string& message, const pb::Descriptor& root) {
  constexpr std::string_view kBefore = "Message type \"";
  constexpr std::string_view kAfter = "\" has no field named";
  const std::size_t begin = message.find(kBefore);
  const std::size_t end = message.find(kAfter);
  if (begin == std::string::npos || end == std::string::npos) {
    return message;
  }
  const std::size_t name = begin + kBefore.size();
  const pb::Descriptor* type =
      root.file()->pool()->FindMessageTypeByName(message.substr(name, end - name));
  return type == nullptr ? message : message + " It has: " + fields_of(*type) + ".";
}

class Collector : public pb::io::ErrorCollector {
 public:
  Collector(std::string name, const pb::Descriptor& root) : name_(std::move(name)), root_(root) {}
  void AddError(int line, pb::io::ColumnNumber column, const std::string& message) override {
    if (!text_.empty()) {
      text_ += '\n';
    }
    text_ += name_ + ":" + std::to_string(line + 1) + ":" + std::to_string(column + 1) + ": ";
    text_ += with_known_fields(message, root_);
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string name_;
  const pb::Descriptor& root_;
  std::string text_;
};

struct Step {
  std::string field;
  int index = -1;  // of a repeated field
};

std::vector<Step> steps_of(const std::string& path) {
  std::vector<Step> steps;
  std::size_t begin = 0;
  while (begin < path.size()) {
    const std::size_t dot = std::min(path.find('.', begin), path.size());
    const std::string part = path.substr(begin, dot - begin);
    const std::size_t bracket = part.find('[');
    Step step{part.substr(0, bracket)};
    if (bracket != std::string::npos) {
      std::from_chars(part.data() + bracket + 1, part.data() + part.size(), step.index);
    }
    steps.push_back(std::move(step));
    begin = dot + 1;
  }
  return steps;
}

std::string one_line(std::string text) {
  for (char& c : text) {
    if (c == '\n') {
      c = ' ';
    }
  }
  return text;
}

bool ends_with(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

}  // namespace

Document::Document(std::string_view text, std::string name, pb::Message& message)
    : name_(std::move(name)),
      is_json_(ends_with(name_, ".json")),
      descriptor_(message.GetDescriptor()) {
  message.Clear();
  if (is_json_) {
    const auto status = pb::util::JsonStringToMessage(
        pb::StringPiece(text.data(), static_cast<std::ptrdiff_t>(text.size())), &message);
    if (!status.ok()) {
      throw core::Error(core::Code::kInvalidArgument,
                        name_ + ": " + one_line(std::string(status.message())));
    }
  } else {
    Collector collector(name_, *descriptor_);
    pb::TextFormat::Parser parser;
    parser.RecordErrorsTo(&collector);
    parser.WriteLocationsTo(&places_);
    if (!parser.ParseFromString(std::string(text), &message)) {
      throw core::Error(core::Code::kInvalidArgument, collector.text());
    }
  }
  refuse_non_finite(message, "");
  throw_if_wrong();
}

void Document::refuse_non_finite(const pb::Message& message, const std::string& path) {
  const pb::Reflection& reflection = *message.GetReflection();
  std::vector<const pb::FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const pb::FieldDescriptor* field : fields) {
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      std::string here = path;
      if (!here.empty()) {
        here += '.';
      }
      here += field->name();
      if (field->is_repeated()) {
        here += '[';
        here += std::to_string(i);
        here += ']';
      }
      if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
        refuse_non_finite(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                               : reflection.GetMessage(message, field),
                          here);
      } else if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_DOUBLE &&
                 !std::isfinite(field->is_repeated()
                                    ? reflection.GetRepeatedDouble(message, field, i)
                                    : reflection.GetDouble(message, field))) {
        complain(here, "the number is not finite; give an ordinary one");
      }
    }
  }
}

std::string Document::place(const std::string& path) const {
  const std::string field_path = path.empty() ? path : path + ": ";
  if (is_json_) {
    return name_ + ": " + field_path;
  }
  const pb::TextFormat::ParseInfoTree* tree = &places_;
  const pb::Descriptor* type = descriptor_;
  pb::TextFormat::ParseLocation location;
  for (const Step& step : steps_of(path)) {
    const pb::FieldDescriptor* field =
        tree == nullptr || type == nullptr ? nullptr : type->FindFieldByName(step.field);
    if (field == nullptr) {
      break;
    }
    const pb::TextFormat::ParseLocation here = tree->GetLocation(field, step.index);
    if (here.line < 0) {
      break;
    }
    location = here;
    type = field->message_type();
    tree = type == nullptr ? nullptr : tree->GetTreeForNested(field, step.index);
  }
  const int line = location.line < 0 ? 0 : location.line;
  const int column = location.line < 0 ? 0 : location.column;
  std::string place = name_ + ":" + std::to_string(line + 1) + ":" + std::to_string(column + 1);
  place += ": ";
  return place + field_path;
}

void Document::complain(const std::string& path, const std::string& what) {
  if (!mistakes_.empty()) {
    mistakes_ += '\n';
  }
  mistakes_ += place(path) + what;
}

void Document::throw_if_wrong() const {
  if (!mistakes_.empty()) {
    throw core::Error(core::Code::kInvalidArgument, mistakes_);
  }
}

}  // namespace weft::v1
