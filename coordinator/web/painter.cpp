#include "coordinator/web/painter.h"

#include <bit>
#include <cstring>
#include <random>

#include <fmt/format.h>

#include "core/clock.h"
#include "core/error.h"
#include "proto/status.h"
#include "security/channel.h"

namespace weft::coordinator {

namespace {

constexpr int kLongestWaitMs = 5'000;  // between attempts to reach a node that is away
constexpr std::chrono::seconds kAnswersWithin{3};
static_assert(std::endian::native == std::endian::little, "planes travel as they lie in memory");

void set_deadline(grpc::ClientContext& context, std::chrono::milliseconds from_now) {
  const gpr_timespec after = gpr_time_from_millis(from_now.count(), GPR_TIMESPAN);
  context.set_deadline(gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), after));
}

std::string new_request_id() {
  std::random_device random;
  return fmt::format("page-{:08x}{:08x}{:08x}", random(), random(), random());
}

// What gRPC says of a node that cannot be reached would not help a person.
[[noreturn]] void throw_away(const std::string& address) {
  throw core::Error(
      core::Code::kUnavailable,
      "the render node at " + address + " does not answer; is weft-render running there?");
}

[[noreturn]] void throw_too_late(const std::string& address) {
  throw core::Error(core::Code::kUnavailable,
                    "the render node at " + address +
                        " did not draw in time; it may be loading the fabric, or drawing for "
                        "others. Ask again in a while");
}

void throw_unless_ok(const grpc::Status& status, const std::string& address) {
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    throw_away(address);
  }
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
    throw_too_late(address);
  }
  v1::throw_unless_ok(status, "draw on " + address);
}

// Where the planes of a picture end that stand before its colour, and how large the colour is.
std::size_t colour_bytes(const v1::PictureHeader& header) {
  if (header.width() == 0 || header.width() > kPictureSideLimit || header.height() == 0 ||
      header.height() > kPictureSideLimit || header.planes_size() == 0 ||
      header.planes(0) != v1::PICTURE_PLANE_COLOUR) {
    throw core::Error(core::Code::kDataLoss,
                      "the render node sends another picture than was ordered; is it of this "
                      "version?");
  }
  return std::size_t{3} * sizeof(float) * header.width() * header.height();
}

}  // namespace

class Painter::Order {
 public:
  Order(Painter& painter, grpc::ClientContext& context, const Wish& wish)
      : painter_(painter), context_(context) {
    std::unique_lock lock(painter_.mutex_);
    if (wish.makes_way) {
      painter_.fewer_.wait_for(lock, wish.in_time,
                               [&] { return painter_.is_stopped_ || painter_.orders_.empty(); });
    }
    if (painter_.is_stopped_) {
      throw core::Error(core::Code::kUnavailable, "the coordinator is stopping");
    }
    if (wish.makes_way && !painter_.orders_.empty()) {
      throw core::Error(core::Code::kUnavailable,
                        "the render node draws for others all the time; ask again in a while");
    }
    std::erase_if(painter_.orders_, [&](const auto& order) {
      const bool is_outdated = !wish.viewer.empty() && order.second.viewer == wish.viewer;
      if (is_outdated || order.second.makes_way) {
        order.first->TryCancel();
        return true;
      }
      return false;
    });
    if (painter_.orders_.size() >= kOrdersAtOnce) {
      throw core::Error(core::Code::kResourceExhausted,
                        fmt::format("pictures_limit: {} pictures are being drawn, which is the "
                                    "limit; ask again in a while",
                                    painter_.orders_.size()));
    }
    painter_.orders_.emplace(&context_, wish);
  }
  ~Order() {
    const std::lock_guard lock(painter_.mutex_);
    painter_.orders_.erase(&context_);
    painter_.fewer_.notify_all();
  }
  // Whether a later order has ended this one.
  [[nodiscard]] bool made_way() const {
    const std::lock_guard lock(painter_.mutex_);
    return !painter_.is_stopped_ && !painter_.orders_.contains(&context_);
  }
  Order(const Order&) = delete;
  Order& operator=(const Order&) = delete;
  Order(Order&&) = delete;
  Order& operator=(Order&&) = delete;

 private:
  Painter& painter_;
  grpc::ClientContext& context_;
};

Painter::Painter(const security::Endpoint& node) : address_(node.address) {
  if (!address_.empty()) {
    channel_ = security::open_channel(node, kLongestWaitMs);
    stub_ = v1::RenderService::NewStub(channel_);
  }
}

Painter::Painting Painter::paint(const v1::Scene& scene, std::chrono::milliseconds in_time,
                                 const std::string& viewer) {
  std::optional<Painting> painting = order(scene, {in_time, viewer, false});
  if (!painting) {
    throw core::Error(core::Code::kCancelled, "another picture was asked for meanwhile");
  }
  return *std::move(painting);
}

Painter::Painting Painter::paint_at_leisure(const v1::Scene& scene,
                                            std::chrono::milliseconds in_time) {
  const core::Stopwatch since_wish;
  while (true) {
    const auto left =
        in_time - std::chrono::milliseconds(static_cast<std::int64_t>(1000 * since_wish.seconds()));
    if (left <= std::chrono::milliseconds(0)) {
      throw_too_late(address_);
    }
    if (std::optional<Painting> painting = order(scene, {left, "", true})) {
      return *std::move(painting);
    }
  }
}

std::optional<Painter::Painting> Painter::order(const v1::Scene& scene, const Wish& wish) {
  if (!has_node()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "no render node is named; start the coordinator with --render-node HOST:PORT "
                      "of a weft-render");
  }
  grpc::ClientContext context;
  const Order order(*this, context, wish);
  set_deadline(context, wish.in_time);
  v1::RenderRequest request;
  request.mutable_order()->set_request_id(new_request_id());
  *request.mutable_order()->mutable_scene() = scene;
  const auto stream = stub_->Render(&context);
  if (stream->Write(request)) {
    stream->WritesDone();
  }
  v1::PictureHeader header;
  std::string bytes;
  std::size_t wanted = 0;
  v1::RenderResponse event;
  try {
    while (stream->Read(&event)) {
      if (event.has_picture()) {
        header = event.picture();
        wanted = colour_bytes(header);
        bytes.clear();
      } else if (event.event_case() == v1::RenderResponse::kChunk && bytes.size() < wanted) {
        bytes += event.chunk();
      }
    }
  } catch (const core::Error&) {
    context.TryCancel();
    static_cast<void>(stream->Finish());
    throw;
  }
  const grpc::Status status = stream->Finish();
  if (!status.ok() && order.made_way()) {
    return std::nullopt;
  }
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE &&
      channel_->GetState(false) == GRPC_CHANNEL_READY) {
    throw core::Error(core::Code::kUnavailable, "the render node at " + address_ +
                                                    " cannot draw now: " + status.error_message());
  }
  throw_unless_ok(status, address_);
  if (wanted == 0 || bytes.size() < wanted) {
    throw core::Error(core::Code::kDataLoss, "the render node ended before the picture had come");
  }
  Painting painting;
  painting.width = header.width();
  painting.height = header.height();
  painting.draw_seconds = header.draw_seconds();
  painting.device = header.device();
  painting.rgb.resize(wanted / sizeof(float));
  std::memcpy(painting.rgb.data(), bytes.data(), wanted);
  return painting;
}

v1::GetNodeResponse Painter::node() {
  if (!has_node()) {
    throw core::Error(core::Code::kFailedPrecondition, "no render node is named");
  }
  grpc::ClientContext context;
  set_deadline(context, kAnswersWithin);
  v1::GetNodeResponse response;
  const grpc::Status status = stub_->GetNode(&context, v1::GetNodeRequest(), &response);
  if (!status.ok()) {
    throw_away(address_);
  }
  return response;
}

void Painter::stop() {
  const std::lock_guard lock(mutex_);
  is_stopped_ = true;
  for (const auto& [context, wish] : orders_) {
    context->TryCancel();
  }
  fewer_.notify_all();
}

}  // namespace weft::coordinator
