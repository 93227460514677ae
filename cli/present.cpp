#include "cli/present.h"

#include <ctime>

#include <fmt/format.h>

#include "core/digest.h"

namespace weft::cli {

namespace {

constexpr std::size_t kShortDigits = 12;

std::string hex(const std::string& binary) {
  const auto digest = core::Digest::from_binary(binary);
  return digest ? digest->hex() : std::string();
}

std::tm utc(std::int64_t at_ms) {
  const auto seconds = static_cast<std::time_t>(at_ms / 1000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  return parts;
}

std::string date_and_time(std::int64_t at_ms, char between) {
  const std::tm parts = utc(at_ms);
  return fmt::format("{:04}-{:02}-{:02}{}{:02}:{:02}:{:02}", parts.tm_year + 1900, parts.tm_mon + 1,
                     parts.tm_mday, between, parts.tm_hour, parts.tm_min, parts.tm_sec);
}

nlohmann::json time_json(std::int64_t at_ms) {
  if (at_ms <= 0) {
    return nullptr;
  }
  return fmt::format("{}.{:03}Z", date_and_time(at_ms, 'T'), at_ms % 1000);
}

std::string state_text(v1::StageState state) {
  switch (state) {
    case v1::STAGE_STATE_WAITING:
      return "waiting";
    case v1::STAGE_STATE_RUNNING:
      return "running";
    case v1::STAGE_STATE_DONE:
      return "done";
    default:
      return "unknown";
  }
}

nlohmann::json to_json(const v1::StageProgress& stage) {
  nlohmann::json json{{"name", stage.name()},
                      {"state", state_text(stage.state())},
                      {"shards", stage.shards()},
                      {"shards_done", stage.shards_done()},
                      {"shards_cached", stage.shards_cached()},
                      {"shards_running", stage.shards_running()},
                      {"shards_per_second", stage.shards_per_second()},
                      {"seconds_left", nullptr},
                      {"failures", stage.failures()},
                      {"started_at", time_json(stage.started_at_ms())},
                      {"ended_at", time_json(stage.ended_at_ms())}};
  if (stage.seconds_left() >= 0) {
    json["seconds_left"] = stage.seconds_left();
  }
  return json;
}

nlohmann::json to_json(const v1::WorkerAttempt& attempt) {
  return {{"job_id", attempt.name().job_id()},    {"attempt", attempt.name().attempt()},
          {"fabric", attempt.fabric()},           {"stage", attempt.stage()},
          {"first_shard", attempt.first_shard()}, {"shards", attempt.shards()},
          {"shards_done", attempt.shards_done()}};
}

}  // namespace

std::string state_text(v1::JobState state) {
  switch (state) {
    case v1::JOB_STATE_QUEUED:
      return "queued";
    case v1::JOB_STATE_RUNNING:
      return "running";
    case v1::JOB_STATE_COMMITTING:
      return "committing";
    case v1::JOB_STATE_SUCCEEDED:
      return "succeeded";
    case v1::JOB_STATE_FAILED:
      return "failed";
    case v1::JOB_STATE_CANCELLED:
      return "cancelled";
    default:
      return "unknown";
  }
}

std::string time_text(std::int64_t at_ms) { return at_ms <= 0 ? "-" : date_and_time(at_ms, ' '); }

std::string short_digest(const std::string& binary_digest) {
  return hex(binary_digest).substr(0, kShortDigits);
}

std::string shards_text(const v1::Job& job) {
  std::uint64_t done = 0;
  std::uint64_t total = 0;
  for (const v1::StageProgress& stage : job.stages()) {
    done += stage.shards_done();
    total += stage.shards();
  }
  return fmt::format("{}/{}", done, total);
}

std::vector<StageProgress> stages_of(const v1::Job& job) {
  std::vector<StageProgress> stages;
  for (const v1::StageProgress& stage : job.stages()) {
    StageProgress progress{stage.name(),
                           stage.shards_done(),
                           stage.shards(),
                           stage.shards_cached(),
                           0,
                           stage.shards_per_second()};
    if (stage.started_at_ms() > 0 && stage.ended_at_ms() > stage.started_at_ms()) {
      progress.seconds = static_cast<double>(stage.ended_at_ms() - stage.started_at_ms()) / 1000.0;
    }
    stages.push_back(progress);
  }
  return stages;
}

nlohmann::json to_json(const v1::Job& job) {
  nlohmann::json stages = nlohmann::json::array();
  for (const v1::StageProgress& stage : job.stages()) {
    stages.push_back(to_json(stage));
  }
  nlohmann::json json{{"id", job.id()},
                      {"fabric", job.fabric()},
                      {"state", state_text(job.state())},
                      {"comment", job.comment()},
                      {"stages", stages},
                      {"error", job.error()},
                      {"waiting_for", job.waiting_for()},
                      {"version", nullptr},
                      {"submitted_at", time_json(job.submitted_at_ms())},
                      {"started_at", time_json(job.started_at_ms())},
                      {"ended_at", time_json(job.ended_at_ms())}};
  if (job.has_version()) {
    json["version"] = to_json(job.version());
  }
  return json;
}

nlohmann::json to_json(const v1::Version& version) {
  return {{"fabric", version.fabric()},
          {"number", version.number()},
          {"reference", reference_text(version)},
          {"content_digest", hex(version.content_digest())},
          {"size_bytes", version.size_bytes()},
          {"file", version.file()},
          {"job_id", version.job_id()},
          {"comment", version.comment()},
          {"published_at", time_json(version.published_at_ms())}};
}

nlohmann::json to_json(const v1::Fabric& fabric) {
  return {{"name", fabric.name()},
          {"versions", fabric.versions()},
          {"latest", to_json(fabric.latest())}};
}

nlohmann::json to_json(const v1::Worker& worker) {
  nlohmann::json attempts = nlohmann::json::array();
  for (const v1::WorkerAttempt& attempt : worker.attempts()) {
    attempts.push_back(to_json(attempt));
  }
  return {{"id", worker.id()},
          {"name", worker.name()},
          {"threads", worker.threads()},
          {"memory_bytes", worker.memory_bytes()},
          {"fingerprint", hex(worker.fingerprint())},
          {"lost", worker.lost()},
          {"last_seen_at", time_json(worker.last_seen_at_ms())},
          {"attempts", attempts},
          {"shards_done", worker.shards_done()},
          {"failures", worker.failures()}};
}

}  // namespace weft::cli
