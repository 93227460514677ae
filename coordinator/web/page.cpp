#include "coordinator/web/page.h"

#include <exception>
#include <utility>

#include <spdlog/spdlog.h>

#include "coordinator/web/assets.h"
#include "coordinator/web/event_stream.h"
#include "coordinator/web/json.h"
#include "core/clock.h"
#include "core/error.h"

namespace weft::coordinator {

namespace {

// Nothing but what we serve runs, is shown or is asked; nobody shows us in a frame. Pictures of
// swatches are shown from memory (blob:), because what went wrong with one is said in words.
constexpr const char* kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

void add_protection(HttpAnswer& answer) {
  answer.headers.emplace_back("Content-Security-Policy", kContentSecurityPolicy);
  answer.headers.emplace_back("X-Content-Type-Options", "nosniff");
  answer.headers.emplace_back("X-Frame-Options", "DENY");
  answer.headers.emplace_back("Referrer-Policy", "no-referrer");
  answer.headers.emplace_back("Cross-Origin-Resource-Policy", "same-origin");
  answer.headers.emplace_back("Cross-Origin-Opener-Policy", "same-origin");
}

HttpAnswer refusal(int status, const core::Error& error) {
  HttpAnswer answer;
  answer.status = status;
  answer.content_type = "application/json";
  answer.body = json_of(error);
  answer.headers.emplace_back("Cache-Control", "no-store");
  if (status == 503) {
    answer.headers.emplace_back("Retry-After", "1");
  }
  return answer;
}

std::vector<std::string> parts_of(const std::string& path) {
  std::vector<std::string> parts;
  std::size_t at = 0;
  while (at < path.size()) {
    const std::size_t slash = path.find('/', at);
    const std::size_t end = slash == std::string::npos ? path.size() : slash;
    if (end > at) {
      parts.push_back(path.substr(at, end - at));
    }
    at = end + 1;
  }
  return parts;
}

std::string content_type_of(std::string_view name) {
  if (name.ends_with(".html")) {
    return "text/html; charset=utf-8";
  }
  if (name.ends_with(".css")) {
    return "text/css; charset=utf-8";
  }
  if (name.ends_with(".js")) {
    return "text/javascript; charset=utf-8";
  }
  return name.ends_with(".svg") ? "image/svg+xml" : "application/octet-stream";
}

HttpAnswer file_answer(const std::string& name, const HttpRequest& request) {
  for (const assets::EmbeddedFile& file : assets::kFiles) {
    if (file.name != name) {
      continue;
    }
    HttpAnswer answer;
    const std::string etag = "\"" + core::digest_of(file.bytes).hex().substr(0, 16) + "\"";
    answer.content_type = content_type_of(name);
    answer.headers.emplace_back("ETag", etag);
    answer.headers.emplace_back("Cache-Control", "no-cache");
    if (request.known_etags.find(etag) != std::string::npos) {
      answer.status = 304;
    } else {
      answer.body = file.bytes;
    }
    return answer;
  }
  throw core::Error(core::Code::kNotFound, "there is no file " + name + " here");
}

// A page of another site may link to us, and no more.
bool is_from_elsewhere(const HttpRequest& request) {
  return !request.fetch_site.empty() && request.fetch_site != "same-origin" &&
         request.fetch_site != "none";
}

}  // namespace

Page::Page(Scheduler& scheduler, Metrics& metrics, const PageOptions& options)
    : scheduler_(scheduler),
      metrics_(metrics),
      state_folder_(options.state_folder),
      gate_(options.listen, options.hosts),
      painter_(options.render_node),
      cache_(options.state_folder / "swatches", options.swatches_limit_bytes),
      swatches_(scheduler.catalogue(), painter_, cache_, metrics),
      api_(scheduler, painter_),
      board_(scheduler),
      disk_use_(scheduler) {
  server_ = std::make_unique<HttpServer>(
      options.listen, gate_, [this](const HttpRequest& request) { return answer(request); });
  if (options.draws_ahead && painter_.has_node()) {
    thumbnails_ahead_ = std::make_unique<ThumbnailsAhead>(scheduler.catalogue(), swatches_);
  }
  spdlog::info("event=page address={} tls={} render_node={}", server_->address(),
               gate_.speaks_tls(), painter_.has_node() ? painter_.address() : "none");
}

Page::~Page() { stop(); }

std::string Page::url() const {
  return (gate_.speaks_tls() ? "https://" : "http://") + server_->address() + "/";
}

void Page::stop() {
  board_.stop();
  painter_.stop();
  thumbnails_ahead_.reset();
  server_->stop();
}

HttpAnswer Page::answer(const HttpRequest& request) {
  const core::Stopwatch since_request;
  HttpAnswer answer;
  try {
    answer = checked(request);
  } catch (const core::Error& error) {
    spdlog::debug("page={} event=refused message=\"{}\"", request.path, error.what());
    answer = refusal(http_status_of(error.code()), error);
  } catch (const std::exception& error) {
    spdlog::error("page={} event=internal_error message=\"{}\"", request.path, error.what());
    answer = refusal(500, core::Error(core::Code::kInternal, error.what()));
  }
  add_protection(answer);
  metrics_.request_answered(answer.status, since_request.seconds());
  return answer;
}

// Who asks, and from where, before what.
HttpAnswer Page::checked(const HttpRequest& request) {
  if (!gate_.is_own_host(request.host)) {
    return refusal(421, core::Error(core::Code::kPermissionDenied,
                                    "'" + request.host +
                                        "' is not a name of this coordinator; start it with "
                                        "--http-host NAME if it is to be called so"));
  }
  if (request.method != "GET" && request.method != "HEAD") {
    HttpAnswer answer = refusal(405, core::Error(core::Code::kPermissionDenied,
                                                 "the page only shows; orders are given by weft"));
    answer.headers.emplace_back("Allow", "GET, HEAD");
    return answer;
  }
  if (is_from_elsewhere(request) && request.path != "/") {
    throw core::Error(core::Code::kPermissionDenied,
                      "a page of another site asks for this; open it in a window of its own");
  }
  const security::Caller caller = gate_.caller_of(request.certificate);
  return routed(request, caller);
}

HttpAnswer Page::routed(const HttpRequest& request, const security::Caller& caller) {
  const std::vector<std::string> parts = parts_of(request.path);
  if (parts.size() > 1 && parts[0] == "api") {
    const std::vector<std::string> path(parts.begin() + 1, parts.end());
    if (path[0] == "events" && path.size() == 1) {
      return events(request, caller);
    }
    if (path[0] == "swatches" && path.size() == 3) {
      security::check_role(caller, "RenderService.Render");
      return swatches_.picture(path[1] + "@" + path[2], request.query);
    }
    return api_.answer(path, request, caller);
  }
  security::check_role(caller, "JobService.ListJobs");
  if (parts.empty()) {
    return file_answer("index.html", request);
  }
  if (parts.size() == 1 && parts[0] == "metrics") {
    return figures();
  }
  if (parts.size() == 1) {
    return file_answer(parts[0], request);
  }
  throw core::Error(core::Code::kNotFound, "there is nothing at " + request.path);
}

HttpAnswer Page::events(const HttpRequest& request, const security::Caller& caller) {
  const auto check = [this, certificate = request.certificate] {
    for (const char* call : {"JobService.WatchJob", "WorkersService.ListWorkers",
                             "CatalogueService.ListFabrics", "JobService.Explain"}) {
      security::check_role(gate_.caller_of(certificate), call);
    }
  };
  security::check_role(caller, "JobService.WatchJob");
  const auto leave = [this](const void* /*place*/) { --streams_; };
  if (++streams_ > kStreamsLimit) {
    --streams_;
    throw core::Error(core::Code::kResourceExhausted,
                      "streams_limit: " + std::to_string(kStreamsLimit) +
                          " browsers watch already, which is the limit; close one");
  }
  // Both shared because httplib copies what it calls; the place is counted until the last one goes.
  const std::shared_ptr<const void> place(&streams_, leave);
  const auto job = request.query.find("job");
  const auto stream = std::make_shared<EventStream>(
      scheduler_, board_, job == request.query.end() ? std::string() : job->second, check);
  HttpAnswer answer;
  answer.content_type = "text/event-stream";
  answer.headers.emplace_back("Cache-Control", "no-store");
  answer.stream = [stream, place](const HttpAnswer::Write& write) { return stream->send(write); };
  return answer;
}

HttpAnswer Page::figures() {
  Metrics::Now now;
  now.census = scheduler_.census();
  now.journal_bytes = scheduler_.journal_bytes();
  now.disk = disk_use_.latest();
  std::error_code failure;
  const std::filesystem::space_info space = std::filesystem::space(state_folder_, failure);
  now.disk_free_bytes = failure ? 0 : space.available;
  now.streams = streams_;
  now.has_problem = scheduler_.fatal_problem().has_value();
  HttpAnswer answer;
  answer.content_type = "text/plain; version=0.0.4; charset=utf-8";
  answer.body = metrics_.text(now);
  answer.headers.emplace_back("Cache-Control", "no-store");
  return answer;
}

}  // namespace weft::coordinator
