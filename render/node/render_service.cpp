#include "render/node/render_service.h"

#include <functional>
#include <map>
#include <thread>
#include <utility>

#include <grpcpp/server_context.h>
#include <spdlog/spdlog.h>

#include "core/clock.h"
#include "core/error.h"
#include "core/version.h"
#include "proto/status.h"
#include "render/draw_pictures.h"
#include "render/make_integrator.h"
#include "render/node/attachments.h"
#include "render/node/dear_question.h"
#include "render/node/drawing_message.h"
#include "render/node/io_guard.h"
#include "render/node/outbox.h"
#include "security/caller.h"

namespace weft::render {
namespace {

using Stream = grpc::ServerReaderWriter<v1::RenderResponse, v1::RenderRequest>;

// Sums, the picture itself and up to three copies on their way to the caller.
std::uint64_t picture_bytes(const v1::Scene& scene) {
  return 2 * GrowingDrawing::size_bytes(draw_settings(scene, 0));
}

}  // namespace

// One call: reads in the thread of the call, writes in one of its own. Receives the pictures.
class RenderService::Conversation : public PictureSink {
 public:
  Conversation(grpc::ServerContext& context, Stream& stream)
      : context_(context),
        stream_(stream),
        is_cancelled_([&context] { return context.IsCancelled(); }),
        guard_([&context] { context.TryCancel(); }) {}
  ~Conversation() override { finish_writing(); }
  Conversation(const Conversation&) = delete;
  Conversation& operator=(const Conversation&) = delete;
  Conversation(Conversation&&) = delete;
  Conversation& operator=(Conversation&&) = delete;

  [[nodiscard]] bool read(v1::RenderRequest& request) {
    return guard_.run([&] { return stream_.Read(&request); });
  }
  void start_writing() {
    writer_ = std::thread([this] { write_all(); });
  }
  // Returns when everything is written, or cannot be.
  void finish_writing() {
    outbox_.close();
    if (writer_.joinable()) {
      writer_.join();
    }
  }
  // Asked at every pixel.
  [[nodiscard]] bool seems_cancelled() { return is_cancelled_(); }
  [[nodiscard]] bool cancelled() const { return context_.IsCancelled(); }
  [[nodiscard]] Outbox& outbox() { return outbox_; }
  std::map<std::string, LoadedFabric>& fabrics() { return fabrics_; }

  [[nodiscard]] bool start(const Frame& frame) override {
    v1::RenderResponse event;
    v1::FrameStarted& started = *event.mutable_frame();
    started.set_frame(frame.number);
    started.set_index(frame.index);
    started.set_count(frame.count);
    started.set_environment_lights(frame.scene.integration().environment_lights());
    for (const std::string& remark : frame.remarks) {
      started.add_remarks(remark);
    }
    for (const auto& [reference, loaded] : fabrics_) {
      v1::RenderedFabric& fabric = *started.add_fabrics();
      fabric.set_reference(reference);
      fabric.set_name(loaded.name);
      fabric.set_content_digest(core::Digest::from_hex(loaded.content_digest)->binary());
    }
    outbox_.put(std::move(event));
    return true;
  }
  void progress(double share_of_frame) override {
    v1::RenderResponse event;
    event.mutable_progress()->set_share(share_of_frame);
    outbox_.put(std::move(event));
  }
  void pass(const Frame& /*frame*/, const Picture& picture) override { outbox_.put_pass(picture); }
  void finish(const Frame& /*frame*/, const Picture& picture) override {
    if (!outbox_.put_finished(picture)) {
      throw core::Error(core::Code::kCancelled, "the caller went away");
    }
  }

 private:
  [[nodiscard]] bool write(const v1::RenderResponse& response) {
    return guard_.run([&] { return stream_.Write(response); });
  }
  [[nodiscard]] bool write_picture(const Outbox::Item& item) {
    v1::RenderResponse response;
    *response.mutable_picture() = header_of(*item.picture, item.finished);
    const v1::PictureHeader header = response.picture();
    return write(response) && send_planes(item.picture->drawing, header, [&](std::string bytes) {
             response.set_chunk(std::move(bytes));
             return write(response);
           });
  }
  void write_all() {
    while (const std::optional<Outbox::Item> item = outbox_.take()) {
      if (!(item->picture ? write_picture(*item) : write(item->event))) {
        outbox_.abandon();
        return;
      }
    }
  }

  grpc::ServerContext& context_;
  Stream& stream_;
  Outbox outbox_;
  DearQuestion is_cancelled_;
  std::map<std::string, LoadedFabric> fabrics_;  // of the order, by reference
  IoGuard guard_;
  std::thread writer_;
};

RenderService::RenderService(const RenderNodeOptions& options)
    : options_(options),
      queue_(options.orders_limit),
      fabrics_(options.coordinator,
               client::FabricCache(options.cache / "fabrics", options.cache_limit_bytes),
               options.memory_limit_bytes) {
  device_ = gpu::open_renderer(options.device);
  if (device_) {
    device_name_ = device_->info().name;
  }
}

void RenderService::draw(const v1::RenderOrder& order, Conversation& conversation) {
  const v1::Scene& scene = order.scene();
  const auto should_stop = [&] { return aborted_ || conversation.seems_cancelled(); };
  const RenderQueue::Place place = queue_.enter(order.request_id());
  conversation.start_writing();
  place.wait(
      [&](std::uint32_t ahead) {
        v1::RenderResponse event;
        event.mutable_queued()->set_ahead(ahead);
        conversation.outbox().put(std::move(event));
      },
      should_stop);
  fabrics_.reserve(picture_bytes(scene) + attachment_bytes(order), "the order");
  const Attachments attachments(order, [&](std::string& chunk) {
    v1::RenderRequest request;
    if (!conversation.read(request)) {
      return false;
    }
    chunk = std::move(*request.mutable_chunk());
    return true;
  });
  const Fabric::Wanted wanted = reads_transfer(scene.integration().integrator())
                                    ? Fabric::Wanted::kFibresAndTransfer
                                    : Fabric::Wanted::kFibres;
  const auto fabric_of = [&](const std::string& reference) {
    const auto report = [&](std::uint64_t here, std::uint64_t total) {
      if (should_stop()) {
        throw core::Error(core::Code::kCancelled, "cancelled while fetching " + reference);
      }
      v1::RenderResponse event;
      event.mutable_fetching()->set_fabric(reference);
      event.mutable_fetching()->set_bytes_here(here);
      event.mutable_fetching()->set_bytes_total(total);
      conversation.outbox().put(std::move(event));
    };
    auto found = conversation.fabrics().find(reference);
    if (found == conversation.fabrics().end()) {
      found =
          conversation.fabrics().emplace(reference, fabrics_.take(reference, wanted, report)).first;
    }
    return found->second.fabric;
  };
  PictureSettings settings;
  settings.threads = options_.threads;
  settings.progressive = order.progressive();
  settings.device = device_.get();
  settings.environment_cache = options_.cache / "environments";
  draw_pictures(scene, settings, fabric_of, attachments.source(), conversation, should_stop);
}

grpc::Status RenderService::Render(grpc::ServerContext* context, Stream* stream) {
  const core::Stopwatch watch;
  v1::RenderRequest first;
  Conversation conversation(*context, *stream);
  grpc::Status status = grpc::Status::OK;
  try {
    static_cast<void>(security::check_role(*context, "RenderService.Render"));
    if (!conversation.read(first) || !first.has_order()) {
      throw core::Error(core::Code::kInvalidArgument, "the stream does not begin with an order");
    }
    check_order(first.order());
    spdlog::info("request={} event=ordered orders={}", first.order().request_id(), queue_.size());
    draw(first.order(), conversation);
  } catch (const core::Error& error) {
    const bool ended_by_us = aborted_ && error.code() == core::Code::kCancelled;
    status = ended_by_us ? grpc::Status(grpc::StatusCode::UNAVAILABLE,
                                        "the render node is ending; ask another one")
                         : v1::to_status(error);
  } catch (const std::exception& error) {
    spdlog::error("request={} event=internal_error message=\"{}\"", first.order().request_id(),
                  error.what());
    status = {grpc::StatusCode::INTERNAL, error.what()};
  }
  conversation.finish_writing();
  if (status.ok() && conversation.cancelled()) {
    status = {grpc::StatusCode::CANCELLED, "the caller went away"};
  }
  spdlog::info("request={} event=ended code={} seconds={:.3f} message=\"{}\"",
               first.order().request_id(), static_cast<int>(status.error_code()), watch.seconds(),
               status.error_message());
  return status;
}

grpc::Status RenderService::GetNode(grpc::ServerContext* context,
                                    const v1::GetNodeRequest* /*request*/,
                                    v1::GetNodeResponse* response) {
  try {
    static_cast<void>(security::check_role(*context, "RenderService.GetNode"));
  } catch (const core::Error& error) {
    return v1::to_status(error);
  }
  response->set_software(std::string("weft ") + core::version());
  response->set_draining(queue_.closed());
  response->set_orders(queue_.size());
  response->set_orders_limit(queue_.limit());
  response->set_memory_limit_bytes(fabrics_.memory_limit_bytes());
  response->set_fabrics_bytes(fabrics_.resident_bytes());
  for (const std::string& digest : fabrics_.resident()) {
    response->add_fabrics(digest);
  }
  response->set_cache_bytes(fabrics_.cache().size_bytes());
  response->set_cache_limit_bytes(fabrics_.cache().limit_bytes());
  response->set_device(device_name_);
  return grpc::Status::OK;
}

}  // namespace weft::render
