#include "coordinator/web/api.h"

#include <algorithm>
#include <charconv>

#include <nlohmann/json.hpp>

#include "coordinator/scheduler/listings.h"
#include "coordinator/web/json.h"
#include "core/error.h"
#include "proto/limits.h"

namespace weft::coordinator {

namespace {

constexpr std::uint64_t kAttemptsUsual = 200;

HttpAnswer json_answer(std::string json) {
  HttpAnswer answer;
  answer.content_type = "application/json";
  answer.body = std::move(json);
  answer.headers.emplace_back("Cache-Control", "no-store");
  return answer;
}

HttpAnswer json_answer(const google::protobuf::Message& message) {
  return json_answer(json_of(message));
}

[[noreturn]] void throw_nothing_there() {
  throw core::Error(core::Code::kNotFound,
                    "there is nothing at this address; docs/status_page.md lists what there is");
}

std::string text_of(const HttpRequest& request, const char* field) {
  const auto found = request.query.find(field);
  return found == request.query.end() ? std::string() : found->second;
}

std::uint64_t number_from(const std::string& text, const char* field) {
  std::uint64_t value = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failure != std::errc() || end != text.data() + text.size()) {
    throw core::Error(core::Code::kInvalidArgument,
                      std::string(field) + " is '" + text + "'; it is a whole number");
  }
  return value;
}

std::uint64_t number_of(const HttpRequest& request, const char* field, std::uint64_t usual,
                        std::uint64_t most) {
  const std::string text = text_of(request, field);
  return text.empty() ? usual : std::min(number_from(text, field), most);
}

}  // namespace

HttpAnswer Api::answer(const std::vector<std::string>& path, const HttpRequest& request,
                       const security::Caller& caller) {
  if (path[0] == "jobs") {
    return jobs(path, request, caller);
  }
  if (path[0] == "workers") {
    return workers(path, caller);
  }
  if (path[0] == "fabrics") {
    return fabrics(path, caller);
  }
  if (path[0] == "diff" && path.size() == 1) {
    security::check_role(caller, "CatalogueService.DiffVersions");
    return difference(request);
  }
  if (path[0] == "node" && path.size() == 1) {
    security::check_role(caller, "RenderService.GetNode");
    return node();
  }
  throw_nothing_there();
}

HttpAnswer Api::jobs(const std::vector<std::string>& path, const HttpRequest& request,
                     const security::Caller& caller) {
  if (path.size() == 1) {
    security::check_role(caller, "JobService.ListJobs");
    v1::ListJobsResponse response;
    for (v1::Job& job :
         scheduler_.jobs(!text_of(request, "unfinished").empty(),
                         number_of(request, "limit", v1::kListLimit, v1::kListLimit))) {
      response.add_jobs()->Swap(&job);
    }
    return json_answer(response);
  }
  const std::string& job = path[1];
  if (path.size() == 2) {
    security::check_role(caller, "JobService.GetJob");
    v1::GetJobResponse response;
    *response.mutable_job() = scheduler_.job(job);
    return json_answer(response);
  }
  if (path.size() == 3 && path[2] == "explain") {
    security::check_role(caller, "JobService.Explain");
    return explanation(job, request);
  }
  if (path.size() == 3 && path[2] == "attempts") {
    security::check_role(caller, "JobService.ListAttempts");
    v1::ListAttemptsRequest asked;
    asked.set_job_id(job);
    asked.set_stage(text_of(request, "stage"));
    if (const std::string shard = text_of(request, "shard"); !shard.empty()) {
      asked.set_with_shard(true);
      asked.set_shard(number_from(shard, "shard"));
    }
    std::uint64_t room = number_of(request, "limit", kAttemptsUsual, v1::kListLimit);
    v1::ListAttemptsResponse response;
    for (v1::AttemptInfo& attempt : scheduler_.attempts(asked)) {
      if (room == 0) {
        break;
      }
      --room;
      response.add_attempts()->Swap(&attempt);
    }
    return json_answer(response);
  }
  if (path.size() == 5 && path[2] == "attempts" && path[4] == "log") {
    security::check_role(caller, "JobService.ReadLogs");
    return log(job, path[3], request);
  }
  throw_nothing_there();
}

HttpAnswer Api::explanation(const std::string& job, const HttpRequest& request) {
  v1::ExplainRequest asked;
  const std::string stage = text_of(request, "stage");
  if (stage.empty()) {
    asked.set_job_id(job);
  } else {
    asked.mutable_task()->set_job_id(job);
    asked.mutable_task()->set_stage(stage);
    asked.mutable_task()->set_shard(number_from(text_of(request, "shard"), "shard"));
  }
  return json_answer(scheduler_.explain(asked));
}

// What follows `offset`, or with `last` the last so many bytes; X-Weft-Next is the offset of what
// follows that.
HttpAnswer Api::log(const std::string& job, const std::string& attempt,
                    const HttpRequest& request) {
  const std::string id = scheduler_.job(job).id();
  const std::uint64_t number = number_from(attempt, "attempt");
  const std::uint64_t last = number_of(request, "last", 0, v1::kLogChunkLimitBytes);
  const std::uint64_t size = scheduler_.logs().size(id, number);
  const std::uint64_t offset =
      last > 0 ? size - std::min(size, last)
               : number_of(request, "offset", 0, std::numeric_limits<std::uint64_t>::max());
  LogStore::Part part = scheduler_.logs().read(id, number, offset, v1::kLogChunkLimitBytes);
  HttpAnswer answer;
  answer.body = std::move(part.text);
  answer.headers.emplace_back("X-Weft-Next", std::to_string(part.next));
  answer.headers.emplace_back("Cache-Control", "no-store");
  return answer;
}

HttpAnswer Api::workers(const std::vector<std::string>& path, const security::Caller& caller) {
  if (path.size() == 1) {
    security::check_role(caller, "WorkersService.ListWorkers");
    v1::ListWorkersResponse response;
    for (v1::Worker& worker : scheduler_.workers()) {
      response.add_workers()->Swap(&worker);
    }
    return json_answer(response);
  }
  if (path.size() == 3 && path[2] == "explain") {
    security::check_role(caller, "JobService.Explain");
    v1::ExplainRequest asked;
    asked.set_worker(path[1]);
    return json_answer(scheduler_.explain(asked));
  }
  throw_nothing_there();
}

HttpAnswer Api::fabrics(const std::vector<std::string>& path, const security::Caller& caller) {
  if (path.size() == 1) {
    security::check_role(caller, "CatalogueService.ListFabrics");
    return json_answer(list_fabrics(scheduler_.catalogue()));
  }
  if (path.size() == 3 && path[2] == "versions") {
    security::check_role(caller, "CatalogueService.ListVersions");
    return json_answer(list_versions(scheduler_.catalogue(), path[1]));
  }
  if (path.size() == 3 && path[2] == "history") {
    security::check_role(caller, "CatalogueService.ListHistory");
    return json_answer(list_history(scheduler_.catalogue(), path[1], v1::kListLimit));
  }
  throw_nothing_there();
}

HttpAnswer Api::difference(const HttpRequest& request) {
  const std::unique_lock lock(comparing_, std::try_to_lock);
  if (!lock.owns_lock()) {
    throw core::Error(core::Code::kResourceExhausted,
                      "comparisons_limit: two other versions are being compared; ask again in a "
                      "while");
  }
  return json_answer(
      diff_versions(scheduler_.catalogue(), text_of(request, "from"), text_of(request, "to")));
}

// Always an answer: that there is no node, or that it is away, is what the page wants to know.
HttpAnswer Api::node() {
  nlohmann::json json = {{"configured", painter_.has_node()}, {"address", painter_.address()}};
  try {
    const v1::GetNodeResponse node = painter_.node();
    json["answers"] = true;
    json["device"] = node.device();
    json["orders"] = node.orders();
    json["draining"] = node.draining();
  } catch (const core::Error& error) {
    json["answers"] = false;
    json["problem"] = error.what();
  }
  return json_answer(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace weft::coordinator
