#include "tests/simulation/checks.h"

#include <algorithm>

#include "core/check.h"

namespace weft::simulation {

using namespace coordinator;

namespace {

template <class... Args>
void require(bool holds, fmt::format_string<Args...> format, Args&&... args) {
  if (!holds) {
    throw Violation(fmt::format(format, std::forward<Args>(args)...));
  }
}

std::string text_of(const std::string& job, StageName stage, std::uint64_t shard) {
  return job + " " + to_string(stage) + " shard " + std::to_string(shard);
}

}  // namespace

void Checks::before(const Queue& queue, const Event& event, Time now) {
  // When the clock jumped, leases last as long as they still had to.
  has_jumped_ = now < last_ || now - last_ > std::chrono::milliseconds(settings_.stall_ms);
  last_ = now;
  if (std::holds_alternative<ReportEvent>(event)) {
    before_ = queue.attempts();
  }
}

void Checks::after(const Queue& queue, const Event& event, const Actions& actions, Time now) {
  ++events_;
  check_results(event, actions);
  check_failures(queue, event, actions, now);
  if (const auto* const report = std::get_if<ReportEvent>(&event)) {
    check_assignments(queue, *report, actions);
    check_freed(queue, *report, actions, now);
  }
  for (const std::string& id : actions.ended) {
    check_troubles(*queue.job(id));
  }
  check_state(queue);
  check_attempts(queue);
}

// A job that was given up says which of its shards are to blame, and on whose word.
void Checks::check_troubles(const JobState& job) {
  if (job.phase != JobPhase::kFailed) {
    return;
  }
  require(!job.error.empty(), "{} failed and does not say why", job.id);
  for (const StageState& stage : job.stages) {
    for (std::size_t i = 0; i < stage.shards.size(); ++i) {
      const bool is_named =
          std::any_of(job.troubles.begin(), job.troubles.end(), [&](const Trouble& trouble) {
            return trouble.kind != Trouble::Kind::kMismatch && trouble.stage == stage.name &&
                   trouble.shard == i && !trouble.workers.empty() && !trouble.message.empty();
          });
      require(is_named == (stage.shards[i] == ShardState::kQuarantined),
              "{} is {}quarantined and the job says otherwise", text_of(job.id, stage.name, i),
              is_named ? "not " : "");
    }
  }
}

void Checks::coordinator_died() { accepted_.clear(); }

void Checks::unavailable(const core::Digest& work) {
  accepted_.erase(work);
  excused_.insert(work);
}

void Checks::loaded(const Queue& queue, const Tables& tables) {
  epoch_ = tables.epoch;
  check_promises(tables, &queue);
  for (const JobState* const job : queue.jobs()) {
    std::map<std::pair<StageName, std::uint64_t>, std::string> liars;
    for (const MismatchRecord& found : tables.mismatches_of(job->id)) {
      liars[{found.stage, found.shard}] = found.liar;
    }
    for (const Trouble& trouble : job->troubles) {
      const auto found = liars.find({trouble.stage, trouble.shard});
      require(found != liars.end() && found->second == trouble.liar,
              "{} tells of results that differ, and its journal does not",
              text_of(job->id, trouble.stage, trouble.shard));
      liars.erase(found);
    }
    require(liars.empty(), "results of {} differed, which is forgotten", job->id);
  }
}

// Each result is taken once: a second one is recorded only where the first was lost or dropped.
void Checks::check_results(const Event& event, const Actions& actions) {
  if (const auto* const lost = std::get_if<ResultLostEvent>(&event)) {
    for (auto it = accepted_.begin(); it != accepted_.end();) {
      if (it->second == lost->result) {
        excused_.insert(it->first);
        it = accepted_.erase(it);
      } else {
        ++it;
      }
    }
  }
  for (const ResultDropRecord& drop : actions.results_dropped) {
    excused_.insert(drop.shard);
    accepted_.erase(drop.shard);
  }
  if (const auto* const planned = std::get_if<PlannedEvent>(&event)) {
    for (const PlannedStage& stage : planned->stages) {
      for (const KnownResult& known : stage.known) {
        accepted_[stage.digests[known.shard]] = known.result;
      }
    }
  }
  for (const ResultRecord& record : actions.results) {
    const auto [known, is_new] = accepted_.emplace(record.shard, record.result);
    const bool came_again = excused_.contains(record.shard) && known->second == record.result;
    require(is_new || came_again, "the result of work {} is taken twice",
            record.shard.hex().substr(0, 8));
  }
}

void Checks::check_assignments(const Queue& queue, const ReportEvent& report,
                               const Actions& actions) {
  std::set<std::uint64_t> seen;
  for (const AssignAction& assign : actions.reply.assignments) {
    require(seen.insert(assign.attempt).second, "attempt {} is assigned twice in one answer",
            assign.attempt);
    const auto known = given_.find(assign.attempt);
    if (known == given_.end()) {
      check_new_assignment(queue, report, assign);
    } else {
      require(known->second.worker == report.worker && known->second.job == assign.job &&
                  known->second.first_shard == assign.first_shard &&
                  known->second.works.size() == assign.shards &&
                  queue.job(assign.job)->fingerprint == report.fingerprint,
              "attempt {} of {} was {}'s and is assigned to {}", assign.attempt, assign.job,
              known->second.worker, report.worker);
    }
    require(queue.attempts().contains(assign.attempt), "attempt {} is assigned and has no lease",
            assign.attempt);
  }
  for (const AttemptName& name : actions.reply.leases) {
    const auto attempt = queue.attempts().find(name.attempt);
    require(report.leaving ||
                (attempt != queue.attempts().end() && attempt->second.worker == report.worker),
            "the lease of attempt {} is renewed for {}, whose it is not", name.attempt,
            report.worker);
  }
}

void Checks::check_new_assignment(const Queue& queue, const ReportEvent& report,
                                  const AssignAction& assign) {
  const JobState* const job = queue.job(assign.job);
  require(job != nullptr && !job->has_ended(), "{} has ended and is assigned", assign.job);
  require(!job->is_paused, "{} is paused and is assigned", assign.job);
  require(!cancelled_.contains(assign.job), "{} is cancelled and is assigned", assign.job);
  const auto paused = paused_.find(assign.job);
  require(paused == paused_.end() || !paused->second, "{} was paused and is assigned", assign.job);
  const auto drained = drained_.find(report.name);
  require(drained == drained_.end() || !drained->second, "{} was drained and is assigned {}",
          report.name, assign.job);
  require(job->fingerprint == report.fingerprint, "{} is assigned to a worker of other numbers",
          assign.job);
  require(!report.leaving, "{} leaves and is assigned {}", report.worker, assign.job);
  for (const std::string& label : job->demands.labels) {
    require(std::find(report.labels.begin(), report.labels.end(), label) != report.labels.end(),
            "{} needs label {}, which {} has not", assign.job, label, report.worker);
  }
  const auto stage =
      std::find_if(job->stages.begin(), job->stages.end(),
                   [&](const StageState& candidate) { return candidate.name == assign.stage; });
  require(stage != job->stages.end() && assign.shards > 0 &&
              assign.first_shard + assign.shards <= stage->shards.size(),
          "attempt {} of {} is not within its stage", assign.attempt, assign.job);
  require(stage->memory_bytes <= report.memory_bytes, "{} {} needs more memory than {} has",
          assign.job, to_string(assign.stage), report.name);
  require(report.wall_left_ms == 0 || Queue::expected_ms(*stage, 1, report.threads) <=
                                          static_cast<double>(report.wall_left_ms),
          "{} is given {} {}, which takes longer than it is there", report.name, assign.job,
          to_string(assign.stage));
  Given& given = given_[assign.attempt];
  given = {assign.job, assign.stage, assign.first_shard, {}, report.worker, assign.purpose, {}};
  for (std::uint64_t i = 0; i < assign.shards; ++i) {
    given.works.push_back(stage->digests[assign.first_shard + i]);
  }
}

// Only the owner of an attempt can fail it, and what failed is written down with the fact.
void Checks::check_failures(const Queue& queue, const Event& event, const Actions& actions,
                            Time now) {
  const auto* const report = std::get_if<ReportEvent>(&event);
  for (const FailureRecord& failure : actions.failures) {
    Verdicts& verdicts = verdicts_[{failure.job, failure.stage, failure.shard}];
    if (failure.kind != TroubleKind::kFailed) {
      verdicts.losses += failure.kind == TroubleKind::kLoneLoss ? 1 : 0;
      verdicts.failures += failure.kind == TroubleKind::kHung ? 1 : 0;
      continue;
    }
    require(report != nullptr, "{} fails without a report",
            text_of(failure.job, failure.stage, failure.shard));
    const bool is_owner = std::any_of(
        report->completions.begin(), report->completions.end(), [&](const CompletionClaim& claim) {
          const auto attempt = before_.find(claim.attempt);
          return claim.failure && !claim.failure->resource_short && claim.job == failure.job &&
                 attempt != before_.end() && attempt->second.worker == report->worker &&
                 attempt->second.token == claim.token &&
                 (has_jumped_ || attempt->second.lease_until >= now);
        });
    require(is_owner, "a superseded attempt fails {}",
            text_of(failure.job, failure.stage, failure.shard));
    ++verdicts.failures;
    std::set<std::string>& workers = verdicts.workers_by_message[failure.message];
    workers.insert(report->name);
    const auto could = [&](const auto& entry) {
      return queue.is_live(entry.second, now) && entry.second.fingerprint == report->fingerprint &&
             !workers.contains(entry.second.name);
    };
    verdicts.all_failed =
        verdicts.all_failed || std::none_of(queue.workers().begin(), queue.workers().end(), could);
  }
}

// What one worker says frees nothing of another's: its shards stay with it, or are done, unless
// their job ended or began again.
void Checks::check_freed(const Queue& queue, const ReportEvent& report, const Actions& actions,
                         Time now) {
  const bool is_upheaval =
      !actions.ended.empty() || !actions.results_dropped.empty() || !actions.bound.empty() ||
      !actions.mismatches.empty() || !actions.blocks.empty() ||
      std::any_of(actions.attempts_ended.begin(), actions.attempts_ended.end(),
                  [](const AttemptEndRecord& record) { return record.outcome == Outcome::kHung; });
  if (is_upheaval) {
    return;
  }
  for (const auto& [id, attempt] : before_) {
    // A machine that died and came back speaks for what it ran before.
    const bool is_successor =
        attempt.worker_name == report.name &&
        std::any_of(report.completions.begin(), report.completions.end(),
                    [&](const CompletionClaim& claim) {
                      return claim.attempt == attempt.id && claim.token == attempt.token;
                    });
    if (attempt.worker == report.worker || is_successor || has_jumped_ ||
        attempt.lease_until < now || queue.attempts().contains(id)) {
      continue;
    }
    const JobState* const job = queue.job(attempt.job);
    require(job != nullptr, "{} is gone", attempt.job);
    const StageState& stage = job->stages.at(attempt.stage);
    for (std::uint64_t i = 0; i < attempt.shards; ++i) {
      require(stage.shards[attempt.first_shard + i] != ShardState::kPending,
              "{} frees {} of attempt {}, which is {}'s", report.worker,
              text_of(attempt.job, stage.name, attempt.first_shard + i), id, attempt.worker);
    }
  }
}

void Checks::check_state(const Queue& queue) {
  for (const JobState* const job : queue.jobs()) {
    if (job->audits_given_up > 0) {
      unaudited_.insert(job->id);
    }
    for (const StageState& stage : job->stages) {
      std::uint64_t running = 0;
      std::uint64_t done = 0;
      for (std::size_t i = 0; i < stage.shards.size(); ++i) {
        running += stage.shards[i] == ShardState::kRunning ? 1 : 0;
        if (stage.shards[i] == ShardState::kDone) {
          ++done;
          const auto accepted = accepted_.find(stage.digests[i]);
          require(accepted == accepted_.end() || accepted->second == stage.results[i] ||
                      job->has_ended() || excused_.contains(stage.digests[i]),
                  "{} has another result than was taken", text_of(job->id, stage.name, i));
        }
      }
      require(running == stage.running && done == stage.done, "{} {} counts wrong", job->id,
              to_string(stage.name));
    }
  }
}

// Every running shard is run by an attempt with a lease; no shard, and no work, by two, but for
// speculation and audits.
void Checks::check_attempts(const Queue& queue) const {
  std::map<core::Digest, std::uint64_t> firsts;  // by work, the newest attempt
  std::map<std::string, std::map<std::size_t, std::set<std::uint64_t>>> covered;
  for (const auto& [id, attempt] : queue.attempts()) {
    const JobState* const job = queue.job(attempt.job);
    require(job != nullptr && !job->has_ended() && attempt.stage < job->stages.size(),
            "attempt {} runs {}, which has ended", id, attempt.job);
    require(!job->is_paused, "attempt {} runs {}, which is paused", id, attempt.job);
    const StageState& stage = job->stages[attempt.stage];
    const auto given = given_.find(id);
    const bool is_first = given == given_.end() || given->second.purpose == Purpose::kFirst;
    for (std::uint64_t i = attempt.first_shard; i < attempt.first_shard + attempt.shards; ++i) {
      if (attempt.skipped.contains(i)) {
        continue;  // it ran before a restart, and another one began it before that was known again
      }
      covered[attempt.job][attempt.stage].insert(i);
      if (is_first && stage.shards[i] == ShardState::kRunning) {
        // Two that skipped parts of one another are both restored after one more restart.
        std::uint64_t& newest = firsts[stage.digests[i]];
        require(newest == 0 || std::max(newest, id) >> 32 < epoch_, "{} has two live attempts",
                text_of(job->id, stage.name, i));
        newest = std::max(newest, id);
      }
    }
    require(given == given_.end() || given->second.worker == attempt.worker,
            "attempt {} changed hands", id);
  }
  for (const JobState* const job : queue.jobs()) {
    for (std::size_t s = 0; s < job->stages.size(); ++s) {
      const StageState& stage = job->stages[s];
      if (stage.running == 0) {
        continue;
      }
      const std::set<std::uint64_t>& shards = covered[job->id][s];
      for (std::size_t i = 0; i < stage.shards.size(); ++i) {
        require(stage.shards[i] != ShardState::kRunning || shards.contains(i),
                "{} runs and nobody has it", text_of(job->id, stage.name, i));
      }
    }
  }
}

void Checks::computed(std::uint64_t attempt, std::uint64_t shard) {
  const auto given = given_.find(attempt);
  require(given != given_.end(), "attempt {} is computed and was never given", attempt);
  const int count = ++given->second.computed[shard];
  require(count == 1, "attempt {} computes shard {} twice", attempt, shard);
}

}  // namespace weft::simulation
