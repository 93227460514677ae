#include <algorithm>
#include <cstdlib>
#include <tuple>
#include <utility>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/text_format.h>

#include "proto/document.h"

namespace weft::v1 {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::FileDescriptor;
using google::protobuf::TextFormat;

struct Place {
  int line = 0;  // from 0, as protobuf counts
  int column = 0;
};

std::string between(const std::string& text, const std::string& before, const std::string& after) {
  const std::size_t from = text.find(before);
  if (from == std::string::npos) {
    return "";
  }
  const std::size_t start = from + before.size();
  const std::size_t end = text.find(after, start);
  return end == std::string::npos ? "" : text.substr(start, end - start);
}

// The values that an enumeration field called `name` takes, wherever in the schema it is.
std::string enum_values(const std::string& name, const FileDescriptor& schema) {
  for (int m = 0; m < schema.message_type_count(); ++m) {
    const FieldDescriptor* field = schema.message_type(m)->FindFieldByName(name);
    if (field == nullptr || field->enum_type() == nullptr) {
      continue;
    }
    std::string list;
    for (int v = 1; v < field->enum_type()->value_count(); ++v) {
      list.append(v == 1 ? "; use " : ", ").append(field->enum_type()->value(v)->name());
    }
    return list;
  }
  return "";
}

// The parser's message with what would be right.
std::string mended(const std::string& message, const FileDescriptor& schema) {
  const std::string field = between(message, "has no field named \"", "\"");
  if (const Descriptor* type =
          schema.pool()->FindMessageTypeByName(between(message, "Message type \"", "\""));
      type != nullptr && !field.empty()) {
    std::vector<std::string> known;
    known.reserve(static_cast<std::size_t>(type->field_count()));
    for (int f = 0; f < type->field_count(); ++f) {
      known.push_back(type->field(f)->name());
    }
    return core::in_quotes(field) + " is no field of " + type->name() +
           core::suggestion(field, known);
  }
  if (message.starts_with("Unknown enumeration value")) {
    const std::string value = between(message, "value of \"", "\"");
    const std::string of = between(message, "for field \"", "\"");
    return core::in_quotes(value) + " is no value of " + of + enum_values(of, schema);
  }
  return message;
}

class TextCollector : public google::protobuf::io::ErrorCollector {
 public:
  TextCollector(std::string_view text, const FileDescriptor& schema)
      : text_(text), schema_(schema) {}
  void AddError(int line, google::protobuf::io::ColumnNumber column,
                const std::string& message) override {
    add(line, column, message);
    failed_ = true;
  }
  // Unknown fields come as warnings, so that parsing goes on behind them.
  void AddWarning(int line, google::protobuf::io::ColumnNumber column,
                  const std::string& message) override {
    add(line, column, message);
  }
  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] const std::vector<std::pair<Place, std::string>>& all() const { return all_; }

 private:
  void add(int line, int column, const std::string& message) {
    constexpr std::size_t kMost = 100;
    if (all_.size() >= kMost) {
      return;
    }
    Place place{std::max(line, 0), std::max(column, 0)};
    // The parser has read on when it finds an unknown field or value: go back to it.
    for (const char* before : {"has no field named \"", "enumeration value of \""}) {
      const std::string word = between(message, before, "\"");
      const std::size_t at =
          line_of(place.line).rfind(word, static_cast<std::size_t>(place.column));
      if (!word.empty() && at != std::string_view::npos) {
        place.column = static_cast<int>(at);
      }
    }
    all_.push_back({place, mended(message, schema_)});
  }

  [[nodiscard]] std::string_view line_of(int number) const {
    std::size_t start = 0;
    for (int line = 0; line < number && start != std::string_view::npos; ++line) {
      start = text_.find('\n', start);
      start = start == std::string_view::npos ? start : start + 1;
    }
    return start == std::string_view::npos ? std::string_view()
                                           : text_.substr(start, text_.find('\n', start) - start);
  }

  std::string_view text_;  // only while parsing
  const FileDescriptor& schema_;
  std::vector<std::pair<Place, std::string>> all_;
  bool failed_ = false;
};

class TextDocument : public Document {
 public:
  TextDocument(std::string_view text, std::string name, google::protobuf::Message& message)
      : name_(std::move(name)), type_(*message.GetDescriptor()), collector_(text, *type_.file()) {
    constexpr int kDeepest = 32;
    TextFormat::Parser parser;
    parser.RecordErrorsTo(&collector_);
    parser.WriteLocationsTo(&places_);
    parser.AllowUnknownField(true);
    parser.SetRecursionLimit(kDeepest);
    unreadable_ = !parser.ParseFromString(std::string(text), &message) || collector_.failed();
  }

  [[nodiscard]] bool names_fields() const override { return false; }

  [[nodiscard]] std::string listing(const core::Mistakes& further) const override {
    std::vector<std::tuple<int, int, std::string>> all;
    for (const auto& [place, message] : collector_.all()) {
      all.emplace_back(place.line, place.column, message);
    }
    for (const core::Mistake& mistake : further) {
      const Place place = place_of(mistake.path);
      all.emplace_back(place.line, place.column, mistake.message);
    }
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
      return std::tie(std::get<0>(a), std::get<1>(a)) < std::tie(std::get<0>(b), std::get<1>(b));
    });
    std::string lines;
    for (const auto& [line, column, message] : all) {
      lines.append(lines.empty() ? "" : "\n").append(name_).append(":");
      lines.append(std::to_string(line + 1)).append(":").append(std::to_string(column + 1));
      lines.append(": ").append(message);
    }
    return lines;
  }

 private:
  // Where the field at `path` is written, or the innermost message round it that is.
  [[nodiscard]] Place place_of(const std::string& path) const {
    Place place;
    const TextFormat::ParseInfoTree* tree = &places_;
    const Descriptor* type = &type_;
    for (std::size_t at = 0; at < path.size() && tree != nullptr && type != nullptr;) {
      const std::size_t end = std::min(path.find('.', at), path.size());
      std::string step = path.substr(at, end - at);
      at = end + 1;
      int index = 0;
      if (const std::size_t bracket = step.find('['); bracket != std::string::npos) {
        index = std::atoi(step.c_str() + bracket + 1);
        step.resize(bracket);
      }
      const FieldDescriptor* field = type->FindFieldByName(step);
      if (field == nullptr) {
        break;
      }
      const int which = field->is_repeated() ? index : -1;
      const TextFormat::ParseLocation location = tree->GetLocation(field, which);
      if (location.line < 0) {
        break;
      }
      place = {location.line, location.column};
      type = field->message_type();
      tree = type != nullptr ? tree->GetTreeForNested(field, which) : nullptr;
    }
    return place;
  }

  std::string name_;
  const Descriptor& type_;
  TextCollector collector_;
  TextFormat::ParseInfoTree places_;
};

}  // namespace

std::unique_ptr<Document> read_text(std::string_view text, const std::string& name,
                                    google::protobuf::Message& message) {
  return std::make_unique<TextDocument>(text, name, message);
}

}  // namespace weft::v1
