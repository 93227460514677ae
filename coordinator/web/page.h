#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/web/api.h"
#include "coordinator/web/board.h"
#include "coordinator/web/disk_use.h"
#include "coordinator/web/http_server.h"
#include "coordinator/web/metrics.h"
#include "coordinator/web/painter.h"
#include "coordinator/web/swatch_cache.h"
#include "coordinator/web/swatches.h"
#include "coordinator/web/thumbnails_ahead.h"
#include "security/endpoint.h"
#include "security/web_gate.h"

namespace weft::coordinator {

struct PageOptions {
  security::Endpoint listen;           // HOST:PORT; port 0: any free one
  std::vector<std::string> hosts;      // further names by which browsers call it
  security::Endpoint render_node;      // empty address: there is none
  std::filesystem::path state_folder;  // thumbnails are kept in swatches/ there
  std::uint64_t swatches_limit_bytes = std::uint64_t{64} << 20;
  bool draws_ahead = true;  // thumbnails of versions as they are published
};

// The status page: what the coordinator does, for people and for Prometheus, over HTTP. It only
// reads: any method but GET and HEAD is refused. docs/status_page.md says what is where.
class Page {
 public:
  // Listens from now on. `scheduler` and `metrics` must outlive it. Throws what security::WebGate,
  // HttpServer, Painter and SwatchCache throw.
  Page(Scheduler& scheduler, Metrics& metrics, const PageOptions& options);
  // Ends as stop() does.
  ~Page();
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;
  Page(Page&&) = delete;
  Page& operator=(Page&&) = delete;

  // "http://127.0.0.1:7413/"
  [[nodiscard]] std::string url() const;
  // Ends what is being answered, streams too, and answers no more.
  void stop();

 private:
  [[nodiscard]] HttpAnswer answer(const HttpRequest& request);
  [[nodiscard]] HttpAnswer checked(const HttpRequest& request);
  [[nodiscard]] HttpAnswer routed(const HttpRequest& request, const security::Caller& caller);
  [[nodiscard]] HttpAnswer events(const HttpRequest& request, const security::Caller& caller);
  [[nodiscard]] HttpAnswer figures();

  Scheduler& scheduler_;
  Metrics& metrics_;
  const std::filesystem::path state_folder_;
  security::WebGate gate_;
  Painter painter_;
  SwatchCache cache_;
  Swatches swatches_;
  Api api_;
  Board board_;
  DiskUse disk_use_;
  std::atomic<int> streams_ = 0;
  std::unique_ptr<ThumbnailsAhead> thumbnails_ahead_;
  std::unique_ptr<HttpServer> server_;
};

}  // namespace weft::coordinator
