#include "core/interrupt.h"

#include <ctime>

namespace weft::core {

namespace {

sigset_t interrupts() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

}  // namespace

sigset_t block_interrupts() {
  const sigset_t signals = interrupts();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

Interrupt::Interrupt() : signals_(interrupts()) { pthread_sigmask(SIG_BLOCK, &signals_, &before_); }

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
