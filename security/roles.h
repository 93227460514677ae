#pragma once

#include <string>
#include <vector>

#include "proto/weft/v1/roles.pb.h"

namespace weft::security {

// From the least that a caller may do to everything.
inline constexpr v1::Role kRoles[] = {v1::ROLE_READER, v1::ROLE_SUBMITTER, v1::ROLE_WORKER,
                                      v1::ROLE_ADMIN};

// "reader", "submitter", "worker", "admin".
[[nodiscard]] std::string to_string(v1::Role role);
// Of roles, separated by ", "; "none" when there is none.
[[nodiscard]] std::string to_string(const std::vector<v1::Role>& roles);

// ROLE_UNSPECIFIED when `name` is none of these.
[[nodiscard]] v1::Role role_from(const std::string& name);

// Whether who has `role` may do what `needed` names (roles.proto has the order). Nobody may do what
// names no role.
[[nodiscard]] bool includes(v1::Role role, v1::Role needed);

}  // namespace weft::security
