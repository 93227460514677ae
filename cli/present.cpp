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

std::string condition_text(const v1::Worker& worker) {
  std::string text = worker.lost() ? "lost" : "live";
  text += worker.drained() ? ", drained" : "";
  text += worker.undelivered().empty() ? "" : ", cannot deliver";
  for (int i = 0; i < worker.blocked_stages_size(); ++i) {
    text += (i == 0 ? ", blocked for " : ", ") + worker.blocked_stages(i);
  }
  return text;
}

std::string time_text(std::int64_t at_ms) {
  if (at_ms <= 0) {
    return "-";
  }
  const std::tm parts = utc(at_ms);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}", parts.tm_year + 1900, parts.tm_mon + 1,
                     parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec);
}

std::string short_digest(const std::string& binary_digest) {
  return hex(binary_digest).substr(0, kShortDigits);
}

std::string reused_text(const v1::Version& version) {
  return version.carried_over_from().empty()
             ? fmt::format("{}/{}", version.cached_shards(),
                           version.cached_shards() + version.computed_shards())
             : "light of " + version.carried_over_from();
}

std::string audits_text(const v1::Job& job) {
  const std::uint64_t count = job.audits_given_up();
  return count == 0 ? ""
                    : fmt::format("{} {} not confirmed: no second worker could do it", count,
                                  count == 1 ? "result was" : "results were");
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

}  // namespace weft::cli
