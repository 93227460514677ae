#include "transport/wide.h"

#include <cstdlib>
#include <string_view>

namespace weft::transport {

bool wide_is_available() {
  const char* portable = std::getenv("WEFT_PORTABLE");  // NOLINT(concurrency-mt-unsafe)
  if (portable != nullptr && std::string_view(portable) == "1") {
    return false;
  }
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}

}  // namespace weft::transport
