#include "worker/attempt_table.h"

#include <algorithm>

#include <fmt/format.h>

#include "core/check.h"
#include "proto/limits.h"

namespace weft::worker {

namespace {

// What is wrong with an assignment; empty when it can be run.
std::string mistake_in(const v1::Assignment& assignment) {
  constexpr int kDigestBytes = 32;
  const auto is_digest = [](const std::string& bytes) { return bytes.size() == kDigestBytes; };
  if (assignment.shards() == 0 || assignment.first_shard() >= assignment.shard_count() ||
      assignment.shards() > assignment.shard_count() - assignment.first_shard()) {
    return "the assignment's run of shards is not within its stage";
  }
  if (!assignment.shard_inputs().empty() &&
      static_cast<std::uint64_t>(assignment.shard_inputs_size()) != assignment.shards()) {
    return "the assignment has not one shard input for each shard";
  }
  if (!std::all_of(assignment.inputs().begin(), assignment.inputs().end(), is_digest) ||
      !std::all_of(assignment.shard_inputs().begin(), assignment.shard_inputs().end(), is_digest)) {
    return "an input of the assignment is not named by a digest";
  }
  return "";
}

bool has_name(const Attempt& attempt, const v1::AttemptName& name) {
  return attempt.assignment.name().attempt() == name.attempt() &&
         attempt.assignment.name().job_id() == name.job_id();
}

}  // namespace

std::string log_name(const Attempt& attempt) {
  const v1::Assignment& assignment = attempt.assignment;
  return fmt::format("job={} attempt={} fabric={} stage={} first_shard={} shards={}",
                     assignment.name().job_id(), assignment.name().attempt(), assignment.fabric(),
                     assignment.stage(), assignment.first_shard(), assignment.shards());
}

void AttemptTable::fill(v1::SynchronizeRequest& request) const {
  for (const auto& attempt : attempts_) {
    if (attempt->is_revoked) {
      continue;
    }
    v1::RunningAttempt& running = *request.add_running();
    running.set_job_id(attempt->assignment.name().job_id());
    running.set_attempt(attempt->assignment.name().attempt());
    running.set_lease_token(attempt->assignment.lease_token());
    running.set_shards_done(attempt->results.size());
    running.set_progress(attempt->progress.load());
    running.set_last_line(attempt->log.last_line());
  }
  for (const auto& [name, completion] : completions_) {
    if (request.completions_size() == v1::kCompletionLimit) {
      break;
    }
    *request.add_completions() = completion;
  }
  request.set_free_attempts(free_attempts());
  request.set_undelivered(undelivered_);
}

bool AttemptTable::set_undelivered(std::string why) {
  const bool is_news = undelivered_.empty() != why.empty();
  undelivered_ = std::move(why);
  return is_news;
}

std::uint32_t AttemptTable::free_attempts() const {
  constexpr std::uint64_t kWantedAhead = 2;
  std::uint64_t held = 0;
  std::uint64_t ahead = 0;  // with shards that are not begun
  for (const auto& attempt : attempts_) {
    held += attempt->is_revoked ? 0 : 1;
    ahead += !attempt->is_closing && attempt->begun < attempt->assignment.shards() ? 1 : 0;
  }
  const std::uint64_t limit = std::min<std::uint64_t>(threads_ + 1, v1::kFreeAttemptsLimit);
  if (is_draining_ || !undelivered_.empty() || held >= limit || ahead >= kWantedAhead ||
      completions_.size() >= static_cast<std::size_t>(v1::kCompletionLimit) / 2) {
    return 0;
  }
  return static_cast<std::uint32_t>(std::min(limit - held, kWantedAhead - ahead));
}

AttemptTable::Changes AttemptTable::apply(const v1::SynchronizeResponse& response) {
  Changes changes;
  for (const v1::AttemptName& name : response.acknowledged()) {
    if (completions_.erase({name.job_id(), name.attempt()}) > 0) {
      ++changes.acknowledged;
      forgotten_.push_back(name);
    }
  }
  for (const v1::AttemptName& name : response.stop()) {
    const auto found = std::find_if(attempts_.begin(), attempts_.end(),
                                    [&](const auto& attempt) { return has_name(*attempt, name); });
    if (found != attempts_.end() && !(*found)->is_revoked) {
      const std::shared_ptr<Attempt> attempt = *found;
      attempt->is_revoked = true;
      close(*attempt);
      end_if_over(attempt);
      changes.revoked.push_back(attempt);
    }
  }
  for (const v1::Assignment& assignment : response.assignments()) {
    const v1::AttemptName& name = assignment.name();
    const bool is_known = completions_.count({name.job_id(), name.attempt()}) > 0 ||
                          std::any_of(attempts_.begin(), attempts_.end(), [&](const auto& attempt) {
                            return has_name(*attempt, name);
                          });
    if (is_known || is_draining_) {
      continue;
    }
    auto attempt = std::make_shared<Attempt>();
    attempt->assignment = assignment;
    attempts_.push_back(attempt);
    changes.assigned.push_back(attempt);
    if (const std::string mistake = mistake_in(assignment); !mistake.empty()) {
      attempt->error.emplace();
      attempt->error->set_kind(v1::ERROR_KIND_TASK_FAILED);
      attempt->error->set_shard(assignment.first_shard());
      attempt->error->set_message(mistake);
      close(*attempt);
      end_if_over(attempt);
    }
  }
  return changes;
}

std::shared_ptr<Attempt> AttemptTable::take_over(const v1::Completion& earlier,
                                                 std::uint64_t undelivered) {
  auto attempt = std::make_shared<Attempt>();
  v1::Assignment& assignment = attempt->assignment;
  assignment.mutable_name()->set_job_id(earlier.job_id());
  assignment.mutable_name()->set_attempt(earlier.attempt());
  assignment.set_lease_token(earlier.lease_token());
  attempt->results.assign(earlier.results().begin(), earlier.results().end());
  attempt->begun = undelivered;
  attempt->in_progress = undelivered;
  attempt->is_revoked = true;
  attempt->is_closing = true;
  attempts_.push_back(attempt);
  end_if_over(attempt);
  return attempt;
}

std::optional<ShardClaim> AttemptTable::claim() {
  for (const auto& attempt : attempts_) {
    if (!attempt->is_closing && attempt->begun < attempt->assignment.shards()) {
      ++attempt->in_progress;
      return ShardClaim{attempt, attempt->assignment.first_shard() + attempt->begun++};
    }
  }
  return std::nullopt;
}

bool AttemptTable::delivered(const ShardClaim& claim, v1::ShardResult result) {
  claim.attempt->results.push_back(std::move(result));
  return given_up(claim);
}

bool AttemptTable::failed(const ShardClaim& claim, v1::TaskError error) {
  if (!claim.attempt->error) {
    claim.attempt->error = std::move(error);
  }
  close(*claim.attempt);
  return given_up(claim);
}

bool AttemptTable::given_up(const ShardClaim& claim) {
  CHECK_GT(claim.attempt->in_progress, 0U);
  --claim.attempt->in_progress;
  return end_if_over(claim.attempt);
}

void AttemptTable::drain() {
  is_draining_ = true;
  const std::vector<std::shared_ptr<Attempt>> attempts = attempts_;
  for (const auto& attempt : attempts) {
    close(*attempt);
    end_if_over(attempt);
  }
}

void AttemptTable::close(Attempt& attempt) {
  attempt.is_closing = true;
  attempt.should_stop.store(true);
}

bool AttemptTable::end_if_over(const std::shared_ptr<Attempt>& attempt) {
  const bool has_more = !attempt->is_closing && attempt->begun < attempt->assignment.shards();
  const auto found = std::find(attempts_.begin(), attempts_.end(), attempt);
  if (has_more || attempt->in_progress > 0 || found == attempts_.end()) {
    return false;
  }
  attempts_.erase(found);
  attempt->is_over.store(true);
  // Of an attempt that is not ours any more only finished shards are of use to anybody.
  const v1::AttemptName& name = attempt->assignment.name();
  if (attempt->is_revoked && attempt->results.empty()) {
    forgotten_.push_back(name);
    return true;
  }
  v1::Completion completion;
  completion.set_job_id(name.job_id());
  completion.set_attempt(name.attempt());
  completion.set_lease_token(attempt->assignment.lease_token());
  for (const v1::ShardResult& result : attempt->results) {
    *completion.add_results() = result;
  }
  if (attempt->error && !attempt->is_revoked) {
    *completion.mutable_error() = *attempt->error;
  }
  completion.set_work_ms(attempt->work_ms);
  completions_[{name.job_id(), name.attempt()}] = std::move(completion);
  return true;
}

}  // namespace weft::worker
