#pragma once

#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

namespace weft::cli {

// A message of the coordinator as programs read it. Names are those of cluster.proto; bytes
// (digests) are hexadecimal; what is named _at_ms is called _at, in ISO 8601 (UTC), null when not
// reached; values of enumerations are in lower case without their prefix; a message that is not set
// is null; an attempt's name is spread into what it names; seconds_left is null when unknown.
// Versions have a `reference` ("silk@3") besides.
[[nodiscard]] nlohmann::json to_json(const google::protobuf::Message& message);

// The same of each message of a list, as an array.
template <class Messages>
[[nodiscard]] nlohmann::json to_json_array(const Messages& messages) {
  nlohmann::json array = nlohmann::json::array();
  for (const auto& message : messages) {
    array.push_back(to_json(message));
  }
  return array;
}

}  // namespace weft::cli
