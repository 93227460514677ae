#include "coordinator/versions/carried_over.h"

#include <nlohmann/json.hpp>

namespace weft::coordinator {

using Json = nlohmann::ordered_json;

std::string carried_over_json(const CarriedOver& carried) {
  return Json{{"base", carried.base},
              {"base_digest", carried.base_digest},
              {"light_error", carried.light_error},
              {"light_error_noise", carried.light_error_noise},
              {"matrix_error", carried.matrix_error}}
      .dump();
}

CarriedOver parse_carried_over(const std::string& json) {
  constexpr int kDeepest = 4;
  const auto is_shallow = [](int depth, Json::parse_event_t, Json&) { return depth <= kDeepest; };
  const Json found = Json::parse(json, is_shallow, false);
  const auto text = [&](const char* key) {
    const bool is_there = found.is_object() && found.contains(key) && found[key].is_string();
    return is_there ? found[key].get<std::string>() : std::string();
  };
  const auto number = [&](const char* key) {
    const bool is_there = found.is_object() && found.contains(key) && found[key].is_number();
    return is_there ? found[key].get<double>() : 0.0;
  };
  return {text("base"), text("base_digest"), number("light_error"), number("light_error_noise"),
          number("matrix_error")};
}

}  // namespace weft::coordinator
