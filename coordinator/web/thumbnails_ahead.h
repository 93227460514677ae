#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/web/swatches.h"

namespace weft::coordinator {

// Has the thumbnail of every version drawn soon after it is published, so that it is there when
// somebody looks, and its fabric in the render node's memory. Versions that were there before are
// drawn when somebody looks. Has a thread of its own; any thread may call.
class ThumbnailsAhead {
 public:
  // Both must outlive it.
  ThumbnailsAhead(Catalogue& catalogue, Swatches& swatches);
  // REQUIRES: the painter behind the swatches is stopped, or a picture is waited for.
  ~ThumbnailsAhead();
  ThumbnailsAhead(const ThumbnailsAhead&) = delete;
  ThumbnailsAhead& operator=(const ThumbnailsAhead&) = delete;
  ThumbnailsAhead(ThumbnailsAhead&&) = delete;
  ThumbnailsAhead& operator=(ThumbnailsAhead&&) = delete;

 private:
  void keep_up();
  // Whether all that is new was drawn, or cannot be.
  [[nodiscard]] bool draw_what_is_new();

  Catalogue& catalogue_;
  Swatches& swatches_;
  std::map<std::string, std::uint64_t> seen_;  // the latest version of each fabric; the thread's
  std::mutex mutex_;                           // guards all below
  std::condition_variable stopping_;
  bool is_stopped_ = false;
  std::thread thread_;
};

}  // namespace weft::coordinator
