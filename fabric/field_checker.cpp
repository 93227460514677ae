#include "fabric/field_checker.h"

#include <algorithm>
#include <cmath>

#include "fabric/description_check.h"
#include "fabric/presets.h"
#include "proto/names.h"

namespace weft::fabric {
namespace {

std::string allowed(const Bounds& bounds) {
  return (bounds.open_low ? "a number above " : "a number from ") + core::shortest(bounds.low) +
         (bounds.open_low ? " up to " : " to ") + core::shortest(bounds.high) + " is needed";
}

bool within(double value, const Bounds& bounds) {
  return std::isfinite(value) && value <= bounds.high &&
         (bounds.open_low ? value > bounds.low : value >= bounds.low);
}

}  // namespace

bool is_name(std::string_view text) { return v1::is_fabric_name(text); }

FieldChecker FieldChecker::at(const std::string& field) const {
  return {mistakes_, path_.empty() ? field : path_ + "." + field};
}

FieldChecker FieldChecker::at(const std::string& field, int index) const {
  return at(field + "[" + std::to_string(index) + "]");
}

void FieldChecker::wrong(const std::string& field, const std::string& message) const {
  constexpr std::size_t kMost = 100;
  if (mistakes_.size() < kMost) {
    mistakes_.push_back({field.empty() ? path_ : at(field).path_, message});
  }
}

void FieldChecker::number(const std::string& field, double value, const Bounds& bounds) const {
  if (!within(value, bounds)) {
    wrong(field, field + " is " + core::shortest(value) + "; " + allowed(bounds));
  }
}

void FieldChecker::needed(const std::string& field, double value, const Bounds& bounds) const {
  if (value == 0) {
    wrong(field, field + " is missing; " + allowed(bounds));
  } else {
    number(field, value, bounds);
  }
}

void FieldChecker::name(const std::string& field, const std::string& value) const {
  if (value.empty()) {
    wrong(field, field + " is missing; give one of small letters, digits, _ and -");
  } else if (!is_name(value)) {
    wrong(field,
          core::in_quotes(value) + " is no name; use small letters, digits, _ and -, at most 64");
  }
}

void FieldChecker::known(const std::string& field, const std::string& value,
                         const std::vector<std::string>& known, const std::string& kind) const {
  if (std::find(known.begin(), known.end(), value) != known.end() && !value.empty()) {
    return;
  }
  std::vector<std::string> possible = known;
  for (const std::string& preset : embedded_names(kind)) {
    possible.push_back(preset);
  }
  if (value.empty()) {
    wrong(field,
          field + " is missing; name one of the " + kind + "s" + core::suggestion("", possible));
  } else {
    wrong(field,
          "there is no " + kind + " " + core::in_quotes(value) + core::suggestion(value, possible));
  }
}

}  // namespace weft::fabric
