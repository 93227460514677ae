#include <algorithm>
#include <set>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// Two different results of one deterministic shard: an alarm. Further workers are asked until two
// agree and are more than any others; those who said otherwise are blocked for that kind of task,
// and what was computed from a wrong result is computed again. When nobody is left to be asked, the
// result is forgotten and the jobs that use it fail: publishing a guess would be worse.

namespace weft::coordinator {

namespace {

std::string in_words(StageName stage, std::uint64_t shard) {
  return std::string(to_string(stage)) + " shard " + std::to_string(shard);
}

std::string shown(const std::string& worker) { return worker.empty() ? "(unknown)" : worker; }

std::vector<std::string> sorted_names(const std::vector<std::string>& workers) {
  std::set<std::string> names;
  for (const std::string& worker : workers) {
    names.insert(shown(worker));
  }
  return {names.begin(), names.end()};
}

std::vector<std::string> names_of(const Dispute& dispute) {
  std::vector<std::string> workers;
  for (const Dispute::Opinion& opinion : dispute.opinions) {
    workers.push_back(opinion.worker);
  }
  return sorted_names(workers);
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "" : ", ") + name;
  }
  return text;
}

// One mismatch is told of each shard: the last.
void tell(JobState& job, Trouble mismatch) {
  const auto told =
      std::find_if(job.troubles.begin(), job.troubles.end(), [&](const Trouble& trouble) {
        return trouble.kind == Trouble::Kind::kMismatch && trouble.stage == mismatch.stage &&
               trouble.shard == mismatch.shard;
      });
  if (told == job.troubles.end()) {
    job.troubles.push_back(std::move(mismatch));
  } else {
    *told = std::move(mismatch);
  }
}

Trouble differing(StageName stage, std::uint64_t shard, std::vector<std::string> workers) {
  const std::string message = in_words(stage, shard) + ": " + listed(workers) +
                              " gave different results; which is right is not yet known";
  return {Trouble::Kind::kMismatch, stage, shard, message, std::move(workers), 0, ""};
}

void name_liar(Trouble& trouble, const std::string& liar) {
  trouble.liar = liar;
  trouble.message = in_words(trouble.stage, trouble.shard) + ": " + liar +
                    " gave a wrong result; others agree on another one";
}

std::vector<std::uint64_t> done_shards(const StageState& stage, StageName name,
                                       const core::Digest& work) {
  std::vector<std::uint64_t> shards;
  for (std::uint64_t i = 0; stage.name == name && i < stage.shards.size(); ++i) {
    if (stage.digests[i] == work && stage.shards[i] == ShardState::kDone) {
      shards.push_back(i);
    }
  }
  return shards;
}

std::vector<std::uint64_t> disputed_shards(const StageState& stage, const core::Digest& work) {
  std::vector<std::uint64_t> shards;
  for (const std::uint64_t shard : stage.disputed) {
    if (stage.digests[shard] == work) {
      shards.push_back(shard);
    }
  }
  return shards;
}

}  // namespace

bool Dispute::has_asked(const std::string& worker) const {
  return std::any_of(opinions.begin(), opinions.end(),
                     [&](const Opinion& opinion) { return opinion.worker == worker; });
}

void Queue::dispute(JobState& job, std::size_t index, std::uint64_t shard,
                    const Dispute::Opinion& opinion, Time now, Actions& actions) {
  const StageState& stage = job.stages[index];
  const core::Digest work = stage.digests[shard];
  const core::Digest recorded = stage.results[shard];
  const std::string& author = author_name(stage.authors[shard]);
  Dispute dispute;
  dispute.stage = stage.name;
  dispute.opinions = {{author, recorded, 0}, opinion};
  if (!open_dispute(work, std::move(dispute), now, actions)) {
    // Its job is being committed: too late for a third opinion there, but others shall not use it.
    actions.mismatches.push_back(
        {job.id, stage.name, shard, author, recorded, opinion.worker, opinion.result, ""});
    actions.results_dropped.push_back({work, recorded});
  }
}

// All jobs that use the work wait for what others say of it; whether there are any.
bool Queue::open_dispute(const core::Digest& work, Dispute dispute, Time now, Actions& actions) {
  dispute.possible_at = now;
  for (auto& [order, job] : jobs_) {
    if (job.has_ended() || job.phase == JobPhase::kCommitting) {
      continue;
    }
    for (StageState& stage : job.stages) {
      for (const std::uint64_t shard : done_shards(stage, dispute.stage, work)) {
        dispute.jobs.insert(order);
        join_dispute(job, stage, shard, dispute, actions);
      }
    }
    refresh(job, now);
  }
  if (dispute.jobs.empty()) {
    return false;
  }
  disputes_[work] = std::move(dispute);
  actions.wake = true;
  return true;
}

void Queue::join_dispute(JobState& job, StageState& stage, std::uint64_t shard,
                         const Dispute& dispute, Actions& actions) {
  const Dispute::Opinion& recorded = dispute.opinions[0];
  const Dispute::Opinion& other = dispute.opinions[1];
  actions.mismatches.push_back({job.id, stage.name, shard, recorded.worker, recorded.result,
                                other.worker, other.result, ""});
  stage.withdraw_audit(shard);
  stage.auditing.remove(shard);
  stage.disputed.insert(shard);
  ++job.revision;
  tell(job, differing(stage.name, shard, names_of(dispute)));
}

// What was found before a restart is told as before.
void Queue::restore_mismatches(JobState& job, const std::vector<MismatchRecord>& mismatches) {
  for (const MismatchRecord& found : mismatches) {
    if (found.liar.empty()) {
      job.open_mismatches.push_back(found);
    }
    Trouble trouble =
        differing(found.stage, found.shard, sorted_names({found.worker, found.other_worker}));
    if (!found.liar.empty()) {
      name_liar(trouble, found.liar);
    }
    tell(job, std::move(trouble));
  }
}

// A shard about which a restart left no verdict: further workers are asked again. Whether it is
// one, and its result one of the two that differ.
bool Queue::dispute_again(JobState& job, std::size_t index, std::uint64_t shard, Time now,
                          Actions& actions) {
  const StageState& stage = job.stages[index];
  const core::Digest& recorded = stage.results[shard];
  const auto open = std::find_if(
      job.open_mismatches.begin(), job.open_mismatches.end(), [&](const MismatchRecord& found) {
        return found.stage == stage.name && found.shard == shard &&
               (found.result == recorded || found.other_result == recorded);
      });
  if (open == job.open_mismatches.end()) {
    return false;
  }
  Dispute dispute;
  dispute.stage = stage.name;
  dispute.opinions = {{open->worker, open->result, 0}, {open->other_worker, open->other_result, 0}};
  if (open->result != recorded) {
    std::swap(dispute.opinions[0], dispute.opinions[1]);
  }
  return open_dispute(core::Digest(stage.digests[shard]), std::move(dispute), now, actions);
}

// One more result of a disputed shard. Each name counts once.
void Queue::hear(const core::Digest& work, const Dispute::Opinion& opinion, Time now,
                 Actions& actions) {
  Dispute& dispute = disputes_.at(work);
  if (dispute.has_asked(opinion.worker)) {
    return;
  }
  dispute.opinions.push_back(opinion);
  std::map<core::Digest, std::set<std::string>> votes;
  for (const Dispute::Opinion& said : dispute.opinions) {
    votes[said.result].insert(said.worker);
  }
  std::size_t most = 0;
  std::size_t next = 0;
  core::Digest right;
  for (const auto& [result, names] : votes) {
    if (names.size() > most) {
      next = most;
      most = names.size();
      right = result;
    } else {
      next = std::max(next, names.size());
    }
  }
  if (most >= 2 && most > next) {
    resolve(work, right, now, actions);
  } else if (dispute.opinions.size() >= settings_.opinion_limit) {
    give_up(work, "no two of the workers asked agree", now, actions);
  } else {
    actions.wake = true;
  }
}

void Queue::resolve(const core::Digest& work, const core::Digest& right, Time now,
                    Actions& actions) {
  const Dispute dispute = std::move(disputes_.at(work));
  disputes_.erase(work);
  std::vector<Dispute::Opinion> honest;
  std::vector<Dispute::Opinion> wrong;
  for (const Dispute::Opinion& opinion : dispute.opinions) {
    (opinion.result == right ? honest : wrong).push_back(opinion);
  }
  if (dispute.opinions.front().result != right) {
    actions.results_dropped.push_back({work, dispute.opinions.front().result});
    actions.results.push_back({work, right, honest[0].size_bytes, honest[0].worker});
  }
  actions.audits.push_back({work, honest[1].worker});
  std::set<std::string> liars;
  for (const Dispute::Opinion& opinion : wrong) {
    liars.insert(opinion.worker);
  }
  for (const Dispute::Opinion& opinion : honest) {
    liars.erase(opinion.worker);  // it once gave the right one: two machines of one name
  }
  liars.erase("");
  const std::string named =
      liars.empty() ? shown(wrong[0].worker) : listed({liars.begin(), liars.end()});
  for (const std::uint64_t order : dispute.jobs) {
    for (Trouble& trouble : jobs_.at(order).troubles) {
      const bool is_it = trouble.kind == Trouble::Kind::kMismatch &&
                         trouble.stage == dispute.stage && is_disputed(order, trouble, work);
      if (is_it) {
        trouble.workers = names_of(dispute);
        name_liar(trouble, named);
        actions.mismatches.push_back({jobs_.at(order).id, dispute.stage, trouble.shard,
                                      honest[0].worker, right, wrong[0].worker, wrong[0].result,
                                      named});
      }
    }
  }
  replace(work, dispute, honest[0], now, actions);
  for (const std::string& liar : liars) {
    block(liar, dispute.stage, true, now, actions);
  }
  for (const std::uint64_t order : dispute.jobs) {
    settle(jobs_.at(order), now, actions);
  }
}

bool Queue::is_disputed(std::uint64_t order, const Trouble& trouble,
                        const core::Digest& work) const {
  const std::vector<StageState>& stages = jobs_.at(order).stages;
  return std::any_of(stages.begin(), stages.end(), [&](const StageState& stage) {
    return stage.name == trouble.stage && stage.disputed.contains(trouble.shard) &&
           stage.digests[trouble.shard] == work;
  });
}

// Gives the jobs the right result. One that computed something from the wrong one begins again.
void Queue::replace(const core::Digest& work, const Dispute& dispute, const Dispute::Opinion& right,
                    Time now, Actions& actions) {
  const bool was_wrong = dispute.opinions.front().result != right.result;
  // Whether others may have computed from the wrong one.
  const auto take_right = [&](StageState& stage, std::uint64_t shard) {
    stage.results[shard] = right.result;
    stage.authors[shard] = author_of(right.worker);
    return stage.is_done();
  };
  for (const std::uint64_t order : dispute.jobs) {
    JobState& job = jobs_.at(order);
    bool was_used = false;
    for (StageState& stage : job.stages) {
      for (const std::uint64_t shard : disputed_shards(stage, work)) {
        stage.disputed.erase(shard);
        ++job.audited_shards;
        was_used = (was_wrong && take_right(stage, shard)) || was_used;
      }
    }
    ++job.revision;
    if (was_used) {
      begin_again(job, now, actions);
    }
    refresh(job, now);
  }
}

// Nobody can tell which result is right: none is kept.
void Queue::give_up(const core::Digest& work, const std::string& why, Time now, Actions& actions) {
  const auto entry = disputes_.find(work);
  if (entry == disputes_.end()) {
    return;
  }
  const Dispute dispute = std::move(entry->second);
  disputes_.erase(entry);
  actions.results_dropped.push_back({work, dispute.opinions.front().result});
  for (const std::uint64_t order : dispute.jobs) {
    JobState& job = jobs_.at(order);
    if (!job.has_ended()) {
      job.error = "a " + std::string(to_string(dispute.stage)) + " shard has different results (" +
                  listed(names_of(dispute)) + "), and " + why +
                  "; let another worker join and retry the job";
      end_job(job, JobPhase::kFailed, now, actions);
    }
  }
}

// The job has ended: a result that nobody looks into any more is not kept for others.
void Queue::leave_disputes(const JobState& job, Actions& actions) {
  const std::uint64_t order = order_of_job_.at(job.id);
  for (auto it = disputes_.begin(); it != disputes_.end();) {
    it->second.jobs.erase(order);
    if (it->second.jobs.empty()) {
      actions.results_dropped.push_back({it->first, it->second.opinions.front().result});
      it = disputes_.erase(it);
    } else {
      ++it;
    }
  }
}

}  // namespace weft::coordinator
