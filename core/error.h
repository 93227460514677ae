#pragma once

#include <stdexcept>
#include <string>

namespace weft::core {

// What kind of thing went wrong in the world outside; maps one to one onto gRPC's status codes and
// onto the command line's exit codes.
enum class Code {
  kInvalidArgument,
  kNotFound,
  kAlreadyExists,
  kFailedPrecondition,
  kPermissionDenied,
  kResourceExhausted,
  kUnavailable,
  kDataLoss,
  kCancelled,
  kInternal,
};

// The one exception of the project: thrown when the outside world failed, never for our own
// mistakes (those are CHECKs). The message says first what was wrong, then what the user can do.
class Error : public std::runtime_error {
 public:
  Error(Code code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] Code code() const { return code_; }

 private:
  Code code_;
};

}  // namespace weft::core
