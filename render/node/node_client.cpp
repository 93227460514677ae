#include "render/node/node_client.h"

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <grpcpp/client_context.h>

#include "client/coordinator.h"
#include "core/digest.h"
#include "core/error.h"
#include "proto/limits.h"
#include "proto/status.h"
#include "render/animation.h"
#include "render/node/drawing_message.h"
#include "security/channel.h"
#include "security/tls_probe.h"

namespace weft::render {
namespace {

using Stream = grpc::ClientReaderWriter<v1::RenderRequest, v1::RenderResponse>;

constexpr std::chrono::milliseconds kBetweenQuestions{50};
// An animation of many frames may take days; a node that is gone is noticed by the keepalive.
constexpr std::chrono::hours kLongestOrder{24 * 14};

// Ends the call when it is time to stop, however long a read takes.
class StopWatcher {
 public:
  StopWatcher(grpc::ClientContext& context, const std::function<bool()>& should_stop)
      : thread_([this, &context, &should_stop] {
          while (!over_) {
            if (should_stop()) {
              stopped_ = true;
              context.TryCancel();
              return;
            }
            std::this_thread::sleep_for(kBetweenQuestions);
          }
        }) {}
  ~StopWatcher() {
    over_ = true;
    thread_.join();
  }
  StopWatcher(const StopWatcher&) = delete;
  StopWatcher& operator=(const StopWatcher&) = delete;
  StopWatcher(StopWatcher&&) = delete;
  StopWatcher& operator=(StopWatcher&&) = delete;
  [[nodiscard]] bool stopped() const { return stopped_; }

 private:
  std::atomic<bool> over_ = false;
  std::atomic<bool> stopped_ = false;
  std::thread thread_;
};

// False when the node ended the call meanwhile; its status says why.
bool send_order(Stream& stream, v1::RenderOrder order, const std::vector<std::string>& files) {
  v1::RenderRequest request;
  *request.mutable_order() = std::move(order);
  bool goes_on = stream.Write(request);
  for (const std::string& bytes : files) {
    for (std::size_t at = 0; at < bytes.size() && goes_on; at += v1::kChunkLimitBytes) {
      request.set_chunk(bytes.substr(at, v1::kChunkLimitBytes));
      goes_on = stream.Write(request);
    }
  }
  return goes_on && stream.WritesDone();
}

}  // namespace

// What comes back, event by event.
class NodeClient::Reception {
 public:
  Reception(const v1::Scene& scene, PictureSink& sink, const NodeReports& reports,
            std::map<std::string, v1::RenderedFabric>& fabrics)
      : scene_(scene),
        settings_(draw_settings(scene, 0)),
        sink_(sink),
        reports_(reports),
        fabrics_(fabrics) {}

  void take(const v1::RenderResponse& event) {
    switch (event.event_case()) {
      case v1::RenderResponse::kQueued:
        if (reports_.queued) {
          reports_.queued(event.queued().ahead());
        }
        break;
      case v1::RenderResponse::kFetching:
        if (reports_.fetching) {
          reports_.fetching(event.fetching());
        }
        break;
      case v1::RenderResponse::kFrame:
        start(event.frame());
        break;
      case v1::RenderResponse::kProgress:
        sink_.progress(event.progress().share());
        break;
      case v1::RenderResponse::kPicture:
        receiver_.emplace(event.picture(), settings_);
        is_finished_ = event.picture().finished();
        break;
      case v1::RenderResponse::kChunk:
        add(event.chunk());
        break;
      default:
        break;  // a later version's event
    }
  }
  [[nodiscard]] std::size_t frames_finished() const { return frames_finished_; }

 private:
  void start(const v1::FrameStarted& started) {
    frame_.number = started.frame();
    frame_.index = started.index();
    frame_.count = started.count();
    frame_.scene = scene_at_frame(scene_, started.frame());
    frame_.scene.mutable_integration()->set_environment_lights(started.environment_lights());
    frame_.remarks.assign(started.remarks().begin(), started.remarks().end());
    fabrics_.clear();
    for (const v1::RenderedFabric& fabric : started.fabrics()) {
      fabrics_[fabric.reference()] = fabric;
    }
    static_cast<void>(sink_.start(frame_));
  }
  void add(const std::string& chunk) {
    if (!receiver_) {
      throw core::Error(core::Code::kDataLoss, "the node sends a picture without a header");
    }
    receiver_->add(chunk);
    if (!receiver_->complete()) {
      return;
    }
    if (is_finished_) {
      sink_.finish(frame_, receiver_->picture());
      ++frames_finished_;
    } else {
      sink_.pass(frame_, receiver_->picture());
    }
    receiver_.reset();
  }

  const v1::Scene& scene_;
  DrawSettings settings_;
  PictureSink& sink_;
  const NodeReports& reports_;
  std::map<std::string, v1::RenderedFabric>& fabrics_;
  Frame frame_;
  std::optional<PictureReceiver> receiver_;
  bool is_finished_ = false;
  std::size_t frames_finished_ = 0;
};

NodeClient::NodeClient(security::Endpoint endpoint)
    : endpoint_(std::move(endpoint)), channel_(security::open_channel(endpoint_)) {
  stub_ = v1::RenderService::NewStub(channel_);
}

std::string NodeClient::explained(const grpc::Status& status) const {
  if (channel_->GetState(false) == GRPC_CHANNEL_READY &&
      status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    return "the render node at " + endpoint_.address +
           " cannot draw now: " + status.error_message();
  }
  if (const std::string problem = security::tls_problem(endpoint_); !problem.empty()) {
    return problem;
  }
  return "no render node answers at " + endpoint_.address + " (" + status.error_message() +
         "); start one with 'weft-render', or name another with --node";
}

void NodeClient::draw_pictures(const v1::Scene& scene, bool progressive, const FileSource& files,
                               PictureSink& sink, const NodeReports& reports,
                               const std::function<bool()>& should_stop) {
  v1::RenderOrder order;
  order.set_request_id(client::new_request_id());
  *order.mutable_scene() = scene;
  order.set_progressive(progressive);
  std::vector<std::string> contents;
  for (const std::string& file : files_of(scene)) {
    contents.push_back(files(file));
    v1::Attachment& attachment = *order.add_attachments();
    attachment.set_name(file);
    attachment.set_size_bytes(contents.back().size());
    attachment.set_digest(core::digest_of(contents.back()).binary());
  }
  grpc::ClientContext context;
  client::Coordinator::set_deadline(context, kLongestOrder);
  const StopWatcher watcher(context, should_stop);
  const auto stream = stub_->Render(&context);
  // Sent beside the reception: a long order may be refused before all of it is sent.
  std::thread sender([&] { static_cast<void>(send_order(*stream, std::move(order), contents)); });
  Reception reception(scene, sink, reports, fabrics_);
  std::exception_ptr problem;
  v1::RenderResponse event;
  while (stream->Read(&event)) {
    try {
      reception.take(event);
    } catch (...) {
      problem = std::current_exception();
      context.TryCancel();
      break;
    }
  }
  sender.join();
  const grpc::Status status = stream->Finish();
  if (problem) {
    std::rethrow_exception(problem);
  }
  if (watcher.stopped()) {
    throw core::Error(core::Code::kCancelled, "cancelled");
  }
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE ||
      status.error_code() == grpc::StatusCode::UNIMPLEMENTED) {
    throw core::Error(core::Code::kUnavailable, explained(status));
  }
  v1::throw_unless_ok(status, "draw on " + endpoint_.address);
  if (reception.frames_finished() != frame_numbers(scene).size()) {
    throw core::Error(core::Code::kDataLoss, "the node ended before all pictures had come");
  }
}

v1::GetNodeResponse NodeClient::node() {
  grpc::ClientContext context;
  client::Coordinator::set_deadline(context, client::kCallDeadline);
  v1::GetNodeResponse response;
  const grpc::Status status = stub_->GetNode(&context, v1::GetNodeRequest(), &response);
  if (!status.ok()) {
    throw core::Error(core::Code::kUnavailable, explained(status));
  }
  return response;
}

}  // namespace weft::render
