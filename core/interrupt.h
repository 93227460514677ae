#pragma once

#include <atomic>
#include <csignal>

namespace weft::core {

// Blocks SIGINT and SIGTERM, which are returned, in the calling thread and in every thread made
// after it: they wait to be asked for.
[[nodiscard]] sigset_t block_interrupts();

// Turns SIGINT and SIGTERM into a question that is asked when it suits. Calls block_interrupts(),
// so construct it in main before any thread is started; children that are spawned inherit the mask
// (core/process.h undoes it). After the first signal the mask of the thread that asked is restored:
// a second Ctrl-C ends the process at once.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  Interrupt(Interrupt&&) = delete;
  Interrupt& operator=(Interrupt&&) = delete;

  // Whether one of the signals has arrived so far. Never blocks; any thread may ask.
  [[nodiscard]] bool requested();

 private:
  sigset_t signals_{};
  sigset_t before_{};
  std::atomic<bool> requested_{false};
};

}  // namespace weft::core
