#include "coordinator/scheduler/messages.h"

#include <algorithm>

#include "core/error.h"
#include "proto/limits.h"
#include "proto/names.h"

namespace weft::coordinator {

namespace {

constexpr const char* kNobody = "nobody";  // who calls without a certificate
constexpr std::int32_t kPriorityLimit = 100;

[[noreturn]] void refuse(const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument, what);
}

void check_count(std::uint64_t count, std::uint64_t limit, const char* field) {
  if (count > limit) {
    refuse(std::string(field) + " is " + std::to_string(count) + "; at most " +
           std::to_string(limit) + " are allowed");
  }
}

CompletionClaim completion_from(const v1::Completion& completion) {
  CompletionClaim claim;
  claim.job = completion.job_id();
  claim.attempt = completion.attempt();
  claim.token = completion.lease_token();
  claim.work_ms = completion.work_ms();
  for (const v1::ShardResult& result : completion.results()) {
    claim.results.push_back(
        {result.shard(), digest_from(result.digest(), "results.digest"), result.size_bytes()});
  }
  if (completion.has_error()) {
    const v1::TaskError& error = completion.error();
    if (error.kind() == v1::ERROR_KIND_UNSPECIFIED) {
      refuse("completions.error.kind is not set");
    }
    claim.failure = Failure{error.kind() == v1::ERROR_KIND_RESOURCE_SHORT, error.shard(),
                            error.message().substr(0, v1::kErrorTextLimitBytes)};
  }
  return claim;
}

}  // namespace

void check_priority(std::int32_t priority) {
  if (priority < -kPriorityLimit || priority > kPriorityLimit) {
    refuse("priority is " + std::to_string(priority) + "; it goes from -100 to 100");
  }
}

std::int64_t to_ms(Time time) { return time.time_since_epoch().count(); }

core::Digest digest_from(const std::string& bytes, const char* field) {
  const std::optional<core::Digest> digest = core::Digest::from_binary(bytes);
  if (!digest) {
    refuse(std::string(field) + " is " + std::to_string(bytes.size()) +
           " bytes long; a digest has 32");
  }
  return *digest;
}

void check_id(const std::string& id, const char* field) {
  if (!v1::is_id(id)) {
    refuse(std::string(field) + " must be 1 to 64 characters of A-Z, a-z, 0-9, _ and -");
  }
}

JobDemands demands_from(const v1::SubmitOptions& options, const security::Caller& caller) {
  check_count(options.comment().size(), v1::kCommentLimitBytes, "the length of options.comment");
  check_count(static_cast<std::uint64_t>(options.labels_size()), v1::kLabelsLimit,
              "options.labels");
  const std::string self = caller.user.empty() ? kNobody : caller.user;
  JobDemands demands;
  demands.user = options.user().empty() ? self : options.user();
  demands.priority = options.priority();
  demands.audit = options.audit();
  demands.labels.assign(options.labels().begin(), options.labels().end());
  if (!v1::is_user_name(demands.user)) {
    refuse(
        "options.user must be 1 to 64 characters of A-Z, a-z, 0-9, _, ., @ and -, and begin "
        "with a letter or a digit");
  }
  if (demands.user != self && !caller.may(v1::ROLE_ADMIN)) {
    throw core::Error(core::Code::kPermissionDenied,
                      "only an admin may submit for another user; leave options.user empty");
  }
  check_priority(demands.priority);
  if (!(demands.audit >= 0 && demands.audit <= 1)) {
    refuse("options.audit is a share: from 0 to 1");
  }
  for (const std::string& label : demands.labels) {
    if (!v1::is_label(label)) {
      refuse("a label must be 1 to 64 characters of A-Z, a-z, 0-9, _, ., = and -");
    }
  }
  return demands;
}

ReportEvent report_from(const v1::SynchronizeRequest& request) {
  check_id(request.request_id(), "request_id");
  check_id(request.worker_id(), "worker_id");
  check_count(request.name().size(), v1::kNameLimitBytes, "the length of name");
  check_count(request.threads(), v1::kThreadsLimit, "threads");
  check_count(request.free_attempts(), v1::kFreeAttemptsLimit, "free_attempts");
  check_count(static_cast<std::uint64_t>(request.labels_size()), v1::kLabelsLimit, "labels");
  check_count(static_cast<std::uint64_t>(request.scenes_size()), v1::kScenesLimit, "scenes");
  check_count(static_cast<std::uint64_t>(request.completions_size()), v1::kCompletionLimit,
              "the number of completions");
  check_count(request.wait_ms(), v1::kWaitLimitMs, "wait_ms");
  if (!request.name().empty() && !v1::is_worker_name(request.name())) {
    refuse("name is not readable text: UTF-8 without control characters");
  }
  if (request.threads() == 0) {
    refuse("threads is 0; a worker has at least one");
  }
  ReportEvent report;
  report.worker = request.worker_id();
  report.name = request.name();
  report.threads = request.threads();
  report.memory_bytes = request.memory_bytes();
  report.fingerprint = digest_from(request.fingerprint(), "fingerprint");
  report.free_attempts = request.leaving() ? 0 : request.free_attempts();
  report.leaving = request.leaving();
  for (const std::string& label : request.labels()) {
    if (!v1::is_label(label)) {
      refuse("a label must be 1 to 64 characters of A-Z, a-z, 0-9, _, ., = and -");
    }
  }
  report.labels.assign(request.labels().begin(), request.labels().end());
  report.wall_left_ms = request.wall_left_ms();
  report.undelivered = request.undelivered().substr(0, v1::kErrorTextLimitBytes);
  for (const std::string& scene : request.scenes()) {
    report.scenes.push_back(digest_from(scene, "scenes"));
  }
  for (const v1::RunningAttempt& running : request.running()) {
    report.running.push_back({running.job_id(), running.attempt(), running.lease_token(),
                              running.shards_done(), running.progress(),
                              running.last_line().substr(0, v1::kLastLineLimitBytes)});
  }
  for (const v1::Completion& completion : request.completions()) {
    report.completions.push_back(completion_from(completion));
  }
  return report;
}

}  // namespace weft::coordinator
