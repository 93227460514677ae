#pragma once

#include <atomic>
#include <condition_variable>
#include <csignal>
#include <mutex>
#include <thread>

#include <grpcpp/client_context.h>

namespace weft::cli {

// Ctrl-C (SIGINT) and SIGTERM as a wish that is heard at once, also while a call to the coordinator
// waits: the call is cancelled. The first `heard` signals are counted; the next one ends the
// process. Construct it before any other thread is started. Any thread may ask.
class Interruption {
 public:
  // REQUIRES: heard > 0.
  explicit Interruption(int heard);
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;
  Interruption(Interruption&&) = delete;
  Interruption& operator=(Interruption&&) = delete;

  [[nodiscard]] bool requested() const;
  // Whether a person did it: a SIGINT. REQUIRES: requested().
  [[nodiscard]] bool is_by_a_person() const;
  // Waits for a second signal for so long. REQUIRES: requested().
  [[nodiscard]] bool requested_again_within(double seconds) const;

  // While one lives, its call is cancelled by the first signal; one at a time.
  class Call {
   public:
    Call(Interruption& interruption, grpc::ClientContext& context);
    ~Call();
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;
    Call(Call&&) = delete;
    Call& operator=(Call&&) = delete;

   private:
    Interruption& interruption_;
  };

 private:
  void listen(const std::stop_token& stop);
  void hear(int signal);

  int heard_;
  sigset_t signals_{};
  sigset_t before_{};
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::atomic<int> count_ = 0;  // asked at every pixel of a picture
  int first_ = 0;
  grpc::ClientContext* call_ = nullptr;
  std::jthread listener_;
};

}  // namespace weft::cli
