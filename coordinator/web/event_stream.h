#pragma once

#include <functional>
#include <memory>
#include <string>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/web/board.h"
#include "coordinator/web/http_server.h"

namespace weft::coordinator {

// Browsers that watch at the same time: each holds a thread of the server.
inline constexpr int kStreamsLimit = 16;

// What one browser watches, as server-sent events: `jobs`, `workers` and `fabrics` as the board has
// them and, of one job, `job` (GetJobResponse) and `explain` (ExplainResponse), each when it
// changes. The data of an event is one line, {"now_ms": ..., "value": ...}. Of one thread.
class EventStream {
 public:
  // `job`: an id or the beginning of one; empty: none. `check` throws core::Error when the caller
  // may not watch any longer.
  EventStream(Scheduler& scheduler, Board& board, std::string job, std::function<void()> check);

  // Sends what is new, waiting for it for a second at most. False when the stream is over.
  [[nodiscard]] bool send(const HttpAnswer::Write& write);

 private:
  // Adds the event, unless it is what was sent last.
  void add_job(std::string& events);
  static void add(std::string& events, const char* name, const std::string& value);

  Scheduler& scheduler_;
  Board::Watcher watcher_;
  std::string job_;
  std::function<void()> check_;
  Board::Views seen_;
  std::string sent_job_;
  std::string sent_reasons_;
  int quiet_rounds_ = 0;
  bool has_begun_ = false;
};

}  // namespace weft::coordinator
