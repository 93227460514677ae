#include "cli/interruption.h"

#include <chrono>
#include <ctime>

#include "core/check.h"
#include "core/interrupt.h"

namespace weft::cli {

namespace {

constexpr long kLookEveryNs = 50'000'000;

}  // namespace

Interruption::Interruption(int heard) : heard_(heard) {
  CHECK(heard > 0);
  pthread_sigmask(SIG_SETMASK, nullptr, &before_);
  signals_ = core::block_interrupts();
  listener_ = std::jthread([this](const std::stop_token& stop) { listen(stop); });
}

Interruption::~Interruption() {
  listener_.request_stop();
  listener_.join();
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

void Interruption::listen(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const timespec wait{0, kLookEveryNs};
    const int signal = sigtimedwait(&signals_, nullptr, &wait);
    if (signal > 0) {
      hear(signal);
    }
  }
}

void Interruption::hear(int signal) {
  const std::lock_guard lock(mutex_);
  if (++count_ > heard_) {
    std::signal(signal, SIG_DFL);
    pthread_sigmask(SIG_UNBLOCK, &signals_, nullptr);
    std::raise(signal);
  }
  if (count_ == 1) {
    first_ = signal;
    if (call_ != nullptr) {
      call_->TryCancel();
    }
  }
  changed_.notify_all();
}

bool Interruption::requested() const { return count_ > 0; }

bool Interruption::is_by_a_person() const {
  const std::lock_guard lock(mutex_);
  return first_ == SIGINT;
}

bool Interruption::requested_again_within(double seconds) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::duration<double>(seconds),
                           [this] { return count_ > 1; });
}

Interruption::Call::Call(Interruption& interruption, grpc::ClientContext& context)
    : interruption_(interruption) {
  const std::lock_guard lock(interruption_.mutex_);
  interruption_.call_ = &context;
  if (interruption_.count_ > 0) {
    context.TryCancel();
  }
}

Interruption::Call::~Call() {
  const std::lock_guard lock(interruption_.mutex_);
  interruption_.call_ = nullptr;
}

}  // namespace weft::cli
