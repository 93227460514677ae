#include "core/interrupt.h"

#include <ctime>

namespace weft::core {

Interrupt::Interrupt() {
  sigemptyset(&signals_);
  sigaddset(&signals_, SIGINT);
  sigaddset(&signals_, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals_, &before_);
}

Interrupt::~Interrupt() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

bool Interrupt::requested() {
  if (requested_.load()) {
    return true;
  }
  const timespec at_once{};
  if (sigtimedwait(&signals_, nullptr, &at_once) > 0) {
    requested_.store(true);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  return requested_.load();
}

}  // namespace weft::core
