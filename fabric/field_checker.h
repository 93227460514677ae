#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/mistakes.h"

namespace weft::fabric {

// What a number may be, both bounds included unless `open_low`.
struct Bounds {
  double low = 0;
  double high = 0;
  bool open_low = false;  // low itself is not allowed
};

// Collects the mistakes of one message of a description; `path` leads to the message.
class FieldChecker {
 public:
  FieldChecker(core::Mistakes& mistakes, std::string path)
      : mistakes_(mistakes), path_(std::move(path)) {}

  // A checker of a field that is a message, and of one of a list.
  [[nodiscard]] FieldChecker at(const std::string& field) const;
  [[nodiscard]] FieldChecker at(const std::string& field, int index) const;

  // Adds a mistake at a field, or at the message itself when `field` is empty.
  void wrong(const std::string& field, const std::string& message) const;

  // Finite and within bounds, or it is a mistake; "x is 7; a number from 0 to 5 is needed".
  void number(const std::string& field, double value, const Bounds& bounds) const;
  // The same; 0 means that it is not set, "x is missing; a number ... is needed".
  void needed(const std::string& field, double value, const Bounds& bounds) const;

  // A name that is well formed.
  void name(const std::string& field, const std::string& value) const;
  // A name that `known` has; `kind`, "yarn" or "material", may also be one of its presets.
  void known(const std::string& field, const std::string& value,
             const std::vector<std::string>& known, const std::string& kind) const;

 private:
  core::Mistakes& mistakes_;
  std::string path_;
};

}  // namespace weft::fabric
