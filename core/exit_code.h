#pragma once

#include "core/error.h"

namespace weft::core {

inline constexpr int kExitFailed = 1;    // the work failed, or an input is wrong
inline constexpr int kExitWrongUse = 2;  // the command line or a setting is wrong
inline constexpr int kExitNotFound = 3;
inline constexpr int kExitRefused = 4;      // not allowed, or over a limit
inline constexpr int kExitUnavailable = 5;  // the coordinator or a file system does not answer

[[nodiscard]] constexpr int exit_code(Code code) {
  switch (code) {
    case Code::kNotFound:
      return kExitNotFound;
    case Code::kPermissionDenied:
    case Code::kResourceExhausted:
      return kExitRefused;
    case Code::kUnavailable:
      return kExitUnavailable;
    default:
      return kExitFailed;
  }
}

}  // namespace weft::core
