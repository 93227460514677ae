#include "coordinator/web/swatches.h"

#include <optional>
#include <utility>

#include <fmt/format.h>

#include "coordinator/web/png.h"
#include "coordinator/web/swatch_view.h"
#include "core/clock.h"
#include "core/error.h"

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

std::string reference_of(const VersionRecord& version) {
  return fmt::format("{}@{}", version.fabric, version.number);
}

}  // namespace

class Swatches::Place {
 public:
  // Waits while another draws the same.
  Place(Swatches& swatches, std::string name) : swatches_(swatches), name_(std::move(name)) {
    std::unique_lock lock(swatches_.mutex_);
    if (swatches_.waiting_ >= kThumbnailsAtOnce) {
      throw core::Error(core::Code::kResourceExhausted,
                        fmt::format("thumbnails_limit: {} thumbnails are waited for, which is the "
                                    "limit; ask again in a while",
                                    swatches_.waiting_));
    }
    ++swatches_.waiting_;
    swatches_.drawn_.wait(lock, [this] { return !swatches_.under_way_.contains(name_); });
    swatches_.under_way_.insert(name_);
  }
  ~Place() {
    const std::lock_guard lock(swatches_.mutex_);
    swatches_.under_way_.erase(name_);
    --swatches_.waiting_;
    swatches_.drawn_.notify_all();
  }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  Place(Place&&) = delete;
  Place& operator=(Place&&) = delete;

 private:
  Swatches& swatches_;
  std::string name_;
};

HttpAnswer Swatches::picture(const std::string& reference,
                             const std::map<std::string, std::string>& query) {
  const VersionRecord version = catalogue_.find(reference);
  const auto kind = query.find("kind");
  const bool is_thumbnail = kind != query.end() && kind->second == "thumbnail";
  return is_thumbnail ? png_answer(thumbnail(version)) : draw_turned(version, query);
}

std::string Swatches::thumbnail(const VersionRecord& version) {
  const std::string name = version.content_digest.hex() + "-" + kThumbnailEdition;
  if (std::optional<std::string> png = cache_.find(name)) {
    return *std::move(png);
  }
  const Place place(*this, name);
  if (std::optional<std::string> png = cache_.find(name)) {
    return *std::move(png);
  }
  const core::Stopwatch since_order;
  const Painter::Painting painting =
      painter_.paint_at_leisure(scene_of(SwatchView(), reference_of(version)), kThumbnailWithin);
  metrics_.swatch_drawn(true, since_order.seconds());
  std::string png =
      png_of(painting.rgb, painting.width, painting.height, automatic_exposure(painting.rgb));
  cache_.keep(name, png);
  return png;
}

HttpAnswer Swatches::draw_turned(const VersionRecord& version,
                                 const std::map<std::string, std::string>& query) {
  const SwatchView view = swatch_view_from(query);
  const auto viewer = query.find("viewer");
  const core::Stopwatch since_order;
  const Painter::Painting painting =
      painter_.paint(scene_of(view, reference_of(version)), kPictureWithin,
                     viewer == query.end() ? std::string() : viewer->second);
  metrics_.swatch_drawn(false, since_order.seconds());
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
