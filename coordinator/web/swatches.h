#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <set>
#include <string>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/web/http_server.h"
#include "coordinator/web/metrics.h"
#include "coordinator/web/painter.h"
#include "coordinator/web/swatch_cache.h"

namespace weft::coordinator {

// Who may wait for thumbnails at the same time: each holds a thread of the server.
inline constexpr std::size_t kThumbnailsAtOnce = 8;

// Pictures of published versions, as the render node draws them. Any thread.
class Swatches {
 public:
  // All must outlive this.
  Swatches(Catalogue& catalogue, Painter& painter, SwatchCache& cache, Metrics& metrics)
      : catalogue_(catalogue), painter_(painter), cache_(cache), metrics_(metrics) {}

  // A PNG of the version `reference` (NAME@NUMBER), as swatch_view_from reads the query; what the
  // `viewer` that it names has asked for before is drawn no longer. With
  // kind=thumbnail it is the view that represents the version, drawn once and kept. The header
  // X-Weft-Stops says the exposure, X-Weft-Draw-Seconds how long the node drew, X-Weft-Device on
  // what. Throws core::Error: what Catalogue::find, swatch_view_from and Painter::paint throw.
  [[nodiscard]] HttpAnswer picture(const std::string& reference,
                                   const std::map<std::string, std::string>& query);

  // A PNG of the view that represents the version: drawn once, when nobody waits for a turned one,
  // and kept. Throws core::Error: kResourceExhausted when kThumbnailsAtOnce are waited for, and
  // what Painter::paint_at_leisure throws.
  [[nodiscard]] std::string thumbnail(const VersionRecord& version);

 private:
  // One who waits for a thumbnail, and who draws it if nobody does.
  class Place;
  [[nodiscard]] HttpAnswer draw_turned(const VersionRecord& version,
                                       const std::map<std::string, std::string>& query);

  Catalogue& catalogue_;
  Painter& painter_;
  SwatchCache& cache_;
  Metrics& metrics_;
  std::mutex mutex_;  // guards all below
  std::condition_variable drawn_;
  std::size_t waiting_ = 0;
  std::set<std::string> under_way_;  // thumbnails that are being drawn, by name
};

}  // namespace weft::coordinator
