#include "security/roles.h"

namespace weft::security {

std::string to_string(v1::Role role) {
  switch (role) {
    case v1::ROLE_READER:
      return "reader";
    case v1::ROLE_SUBMITTER:
      return "submitter";
    case v1::ROLE_WORKER:
      return "worker";
    case v1::ROLE_ADMIN:
      return "admin";
    default:
      return "unspecified";
  }
}

std::string to_string(const std::vector<v1::Role>& roles) {
  std::string text;
  for (const v1::Role role : roles) {
    text += (text.empty() ? "" : ", ") + to_string(role);
  }
  return text.empty() ? "none" : text;
}

v1::Role role_from(const std::string& name) {
  for (const v1::Role role : kRoles) {
    if (to_string(role) == name) {
      return role;
    }
  }
  return v1::ROLE_UNSPECIFIED;
}

bool includes(v1::Role role, v1::Role needed) {
  switch (needed) {
    case v1::ROLE_READER:
      return role == v1::ROLE_READER || role == v1::ROLE_SUBMITTER || role == v1::ROLE_ADMIN;
    case v1::ROLE_SUBMITTER:
      return role == v1::ROLE_SUBMITTER || role == v1::ROLE_ADMIN;
    case v1::ROLE_WORKER:
      return role == v1::ROLE_WORKER || role == v1::ROLE_ADMIN;
    case v1::ROLE_ADMIN:
      return role == v1::ROLE_ADMIN;
    default:
      return false;
  }
}

}  // namespace weft::security
