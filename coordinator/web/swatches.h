#pragma once

#include <map>
#include <string>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/web/http_server.h"
#include "coordinator/web/metrics.h"
#include "coordinator/web/painter.h"
#include "coordinator/web/swatch_cache.h"

namespace weft::coordinator {

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

 private:
  [[nodiscard]] HttpAnswer draw(const VersionRecord& version,
                                const std::map<std::string, std::string>& query, bool is_thumbnail);

  Catalogue& catalogue_;
  Painter& painter_;
  SwatchCache& cache_;
  Metrics& metrics_;
};

}  // namespace weft::coordinator
