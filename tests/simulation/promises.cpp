#include <algorithm>

#include "tests/simulation/checks.h"

// What was acknowledged to somebody.

namespace weft::simulation {

using namespace coordinator;

namespace {

template <class... Args>
void require(bool holds, fmt::format_string<Args...> format, Args&&... args) {
  if (!holds) {
    throw Violation(fmt::format(format, std::forward<Args>(args)...));
  }
}

void set_or_forget(std::map<std::string, bool>& states, const std::string& name,
                   std::optional<bool> state) {
  if (state) {
    states[name] = *state;
  } else {
    states.erase(name);
  }
}

}  // namespace

void Checks::paused(const std::string& job, std::optional<bool> is_paused) {
  set_or_forget(paused_, job, is_paused);
}

void Checks::drained(const std::string& worker, std::optional<bool> is_drained) {
  set_or_forget(drained_, worker, is_drained);
}

void Checks::check_promises(const Tables& tables, const Queue* queue) const {
  for (const std::string& job : submitted_) {
    const auto row = tables.jobs.find(job);
    require(row != tables.jobs.end(), "{} was acknowledged and is forgotten", job);
    require(queue == nullptr || row->second.end != End::kNone || queue->job(job) != nullptr,
            "{} has not ended and the queue does not know it", job);
  }
  for (const std::string& job : cancelled_) {
    require(tables.jobs.at(job).end != End::kNone, "{} was cancelled and goes on", job);
  }
  for (const auto& [job, is_paused] : paused_) {
    const JobRow& row = tables.jobs.at(job);
    require(row.end != End::kNone || row.is_paused == is_paused,
            "{} was paused or resumed, which is forgotten", job);
  }
  for (const auto& [worker, is_drained] : drained_) {
    require(tables.drained.contains(worker) == is_drained,
            "{} was drained or undrained, which is forgotten", worker);
  }
}

// Whether the job has just that work.
bool Checks::is_wanted(const JobState& job, const Given& given) {
  return std::any_of(job.stages.begin(), job.stages.end(), [&](const StageState& stage) {
    return stage.name == given.stage &&
           given.first_shard + given.works.size() <= stage.digests.size() &&
           std::equal(given.works.begin(), given.works.end(),
                      stage.digests.begin() + static_cast<std::ptrdiff_t>(given.first_shard));
  });
}

std::vector<core::Digest> Checks::acknowledged(const ReportEvent& report, const Reply& reply,
                                               const Queue& queue) const {
  std::vector<core::Digest> works;
  for (const AttemptName& name : reply.acknowledged) {
    const auto claim =
        std::find_if(report.completions.begin(), report.completions.end(),
                     [&](const CompletionClaim& c) { return c.attempt == name.attempt; });
    require(claim != report.completions.end(), "attempt {} is acknowledged and was not reported",
            name.attempt);
    const auto given = given_.find(name.attempt);
    const JobState* const job = queue.job(name.job);
    // A liar's results of that kind are not taken, nor any of a run of which a part was computed
    // from what proved to be wrong.
    if (given == given_.end() || job == nullptr || job->has_ended() ||
        queue.is_liar(report.name, given->second.stage) || !is_wanted(*job, given->second)) {
      continue;
    }
    for (const ShardResult& result : claim->results) {
      const std::uint64_t index = result.shard - given->second.first_shard;
      if (result.shard < given->second.first_shard || index >= given->second.works.size()) {
        continue;
      }
      works.push_back(given->second.works[index]);
    }
  }
  return works;
}

// A completion that is acknowledged is on the disk, as far as anybody wants it.
void Checks::answered(const std::vector<core::Digest>& acknowledged, const Reply& reply,
                      const Tables& durable) const {
  for (const core::Digest& work : acknowledged) {
    require(durable.results.contains(work) || excused_.contains(work),
            "work {} is acknowledged and not on the disk", work.hex().substr(0, 8));
  }
  for (const AssignAction& assign : reply.assignments) {
    const auto known = durable.jobs.find(assign.job);
    require(known != durable.jobs.end(), "{} is assigned and not on the disk", assign.job);
  }
}

bool Checks::is_rightly_given_up(const std::string& job) const {
  return std::any_of(verdicts_.begin(), verdicts_.end(), [&](const auto& entry) {
    const Verdicts& verdicts = entry.second;
    const bool is_same_everywhere =
        std::any_of(verdicts.workers_by_message.begin(), verdicts.workers_by_message.end(),
                    [&](const auto& m) { return m.second.size() >= settings_.same_error_limit; });
    return entry.first.job == job && (verdicts.failures >= settings_.failure_limit ||
                                      verdicts.losses >= settings_.lonely_loss_limit ||
                                      is_same_everywhere || verdicts.all_failed);
  });
}

}  // namespace weft::simulation
