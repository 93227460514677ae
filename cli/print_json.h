#pragma once

#include <cstdio>

#include <nlohmann/json.hpp>

namespace weft::cli {

// One JSON value on stdout, indented, with a line break. A name that is not UTF-8 must not end the
// command: its bytes are replaced.
template <class Json = nlohmann::json>
void print_json(const Json& json) {
  std::printf("%s\n", json.dump(2, ' ', false, Json::error_handler_t::replace).c_str());
}

}  // namespace weft::cli
