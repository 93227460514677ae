#include "coordinator/web/swatches.h"

#include <utility>

#include <fmt/format.h>

#include "coordinator/web/png.h"
#include "coordinator/web/swatch_view.h"
#include "core/clock.h"

namespace weft::coordinator {

namespace {

// A fabric that the node has not in its memory is fetched and read first.
constexpr std::chrono::seconds kThumbnailWithin{120};
constexpr std::chrono::seconds kPictureWithin{60};
constexpr const char* kPng = "image/png";

HttpAnswer png_answer(std::string png) {
  HttpAnswer answer;
  answer.content_type = kPng;
  answer.body = std::move(png);
  // A version never changes, and neither does a view of it.
  answer.headers.emplace_back("Cache-Control", "private, max-age=86400, immutable");
  return answer;
}

}  // namespace

HttpAnswer Swatches::picture(const std::string& reference,
                             const std::map<std::string, std::string>& query) {
  const VersionRecord version = catalogue_.find(reference);
  const auto kind = query.find("kind");
  if (kind == query.end() || kind->second != "thumbnail") {
    return draw(version, query, false);
  }
  const std::string name = version.content_digest.hex() + "-" + kThumbnailEdition;
  if (std::optional<std::string> png = cache_.find(name)) {
    return png_answer(*std::move(png));
  }
  HttpAnswer answer = draw(version, {}, true);
  cache_.keep(name, answer.body);
  return answer;
}

HttpAnswer Swatches::draw(const VersionRecord& version,
                          const std::map<std::string, std::string>& query, bool is_thumbnail) {
  const SwatchView view = swatch_view_from(query);
  const auto viewer = query.find("viewer");
  const core::Stopwatch since_order;
  const Painter::Painting painting =
      painter_.paint(scene_of(view, fmt::format("{}@{}", version.fabric, version.number)),
                     is_thumbnail ? kThumbnailWithin : kPictureWithin,
                     viewer == query.end() ? std::string() : viewer->second);
  metrics_.swatch_drawn(is_thumbnail, since_order.seconds());
  const float stops = view.stops.value_or(automatic_exposure(painting.rgb));
  HttpAnswer answer = png_answer(png_of(painting.rgb, painting.width, painting.height, stops));
  answer.headers.emplace_back("X-Weft-Stops", fmt::format("{:.3f}", stops));
  answer.headers.emplace_back("X-Weft-Draw-Seconds", fmt::format("{:.3f}", painting.draw_seconds));
  // What the node says of itself goes into no header as it is.
  std::string device;
  for (const char c : painting.device) {
    device += c >= ' ' && c <= '~' ? c : '?';
  }
  answer.headers.emplace_back("X-Weft-Device", device);
  return answer;
}

}  // namespace weft::coordinator
