#pragma once

#include <string_view>

// What names may be. Most of them become files or folders somewhere: one that passes is no path and
// leaves none. Each rule stands here once, and cluster.proto states it where the name appears.

namespace weft::v1 {

// Of a fabric: [a-z0-9][a-z0-9_-]{0,63}.
[[nodiscard]] bool is_fabric_name(std::string_view text);

// Of a version: [a-z0-9][a-z0-9_.-]{0,63}, not a number and not "latest".
[[nodiscard]] bool is_tag(std::string_view text);

// Of a call (request_id) or a worker process: [A-Za-z0-9_-]{1,64}.
[[nodiscard]] bool is_id(std::string_view text);

// Of a job: "j" and twelve lower-case hexadecimal digits.
[[nodiscard]] bool is_job_id(std::string_view text);
// What may begin one: 1 to 13 characters.
[[nodiscard]] bool begins_job_id(std::string_view text);

// Of a user, or of whom a certificate names: [A-Za-z0-9][A-Za-z0-9_.@-]{0,63}.
[[nodiscard]] bool is_user_name(std::string_view text);

// Of a worker's property: [A-Za-z0-9_.=-]{1,64}.
[[nodiscard]] bool is_label(std::string_view text);

// Of a worker, for people: UTF-8 of 1 to 128 bytes without control characters. Never a path.
[[nodiscard]] bool is_worker_name(std::string_view text);

}  // namespace weft::v1
