#include "security/grpc_log.h"

#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

namespace weft::security {

void log_what_grpc_says() {
  gpr_set_log_function([](gpr_log_func_args* said) {
    if (said->severity == GPR_LOG_SEVERITY_ERROR) {
      spdlog::warn("event=grpc message=\"{}\"", said->message);
    }
  });
}

void silence_grpc() {
  gpr_set_log_function([](gpr_log_func_args* /*said*/) {});
}

}  // namespace weft::security
