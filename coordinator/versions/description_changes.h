#pragma once

#include <string>
#include <vector>

#include <google/protobuf/message.h>

namespace weft::coordinator {

// A field that differs between two messages of one type.
struct FieldDifference {
  std::string path;  // "materials[0].c_tt.r"
  std::string from;  // empty: it was not there
  std::string to;
};

inline constexpr std::size_t kFieldDifferencesLimit = 1000;

// Where two messages of one type differ, field by field, in the order of the fields' numbers.
// Elements of lists are compared by their place. What is beyond kFieldDifferencesLimit is left out.
[[nodiscard]] std::vector<FieldDifference> differences_of(const google::protobuf::Message& from,
                                                          const google::protobuf::Message& to);

}  // namespace weft::coordinator
