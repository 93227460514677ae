#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <vector>

#include <grpcpp/channel.h>

#include "proto/weft/v1/cluster.grpc.pb.h"
#include "worker/attempt_table.h"

namespace weft::worker {

// Sends what attempts log to the coordinator: once a second, and when an attempt is over. Lines of
// ended attempts wait while the coordinator is away, of so many attempts at most. Any thread.
class LogSender {
 public:
  explicit LogSender(const std::shared_ptr<grpc::Channel>& channel);

  void follow(std::shared_ptr<Attempt> attempt);
  void hurry();

  // Sends until it is closed, then once more, for two seconds at most.
  void run();
  void close();

 private:
  enum class Sent { kAll, kGone, kNotNow };

  bool wait();
  void send_round();
  [[nodiscard]] Sent send(Attempt& attempt) const;

  std::unique_ptr<v1::WorkerService::Stub> stub_;
  std::mutex mutex_;
  std::condition_variable changed_;
  struct Followed {
    std::shared_ptr<Attempt> attempt;
    bool was_over = false;  // in the last round: its last line is written by now
  };
  std::vector<Followed> attempts_;  // in the order they came
  bool is_hurried_ = false;
  bool is_closed_ = false;
};

}  // namespace weft::worker
