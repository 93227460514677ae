#include <algorithm>
#include <numeric>
#include <sstream>

#include "coordinator/journal/journal.h"
#include "coordinator/journal/state.h"

// What the journal is asked.

namespace weft::coordinator {

namespace {

// How many look-ups are made before others may use the connection.
constexpr std::size_t kLookupsAtOnce = 4096;

constexpr const char* kJobColumns =
    "id, request_id, fabric, description, comment, fingerprint, submitted_at_ms, ended_at_ms, "
    "summary, user, priority, audit, labels, paused, retries";

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) {
    words.push_back(word);
  }
  return words;
}

JobRecord job_of(const Statement& s) {
  JobRecord job;
  job.id = s.bytes_of(0);
  job.request_id = s.bytes_of(1);
  job.fabric = s.bytes_of(2);
  job.description = s.bytes_of(3);
  job.comment = s.bytes_of(4);
  if (!s.bytes_of(5).empty()) {
    job.fingerprint = s.digest_of(5);
  }
  job.submitted_at_ms = s.signed_of(6);
  job.ended_at_ms = s.signed_of(7);
  job.summary = s.bytes_of(8);
  job.demands.user = s.bytes_of(9);
  job.demands.priority = static_cast<std::int32_t>(s.signed_of(10));
  job.demands.audit = s.real_of(11);
  job.demands.labels = words_of(s.bytes_of(12));
  job.is_paused = s.number_of(13) != 0;
  job.retries = static_cast<std::uint32_t>(s.number_of(14));
  return job;
}

std::string select_jobs(const char* rest) {
  return std::string("SELECT ") + kJobColumns + " FROM jobs " + rest;
}

constexpr const char* kAttemptColumns =
    "attempt, stage, first_shard, shards, worker, worker_name, purpose, began_at_ms, ended_at_ms, "
    "outcome, shards_done, message, taken_up, taken_up_at_ms, earlier_outcome, earlier_ended_at_ms";

AttemptRecord attempt_of(const std::string& job, const Statement& s) {
  AttemptRecord attempt;
  attempt.job = job;
  attempt.attempt = s.number_of(0);
  attempt.stage = static_cast<StageName>(s.number_of(1));
  attempt.first_shard = s.number_of(2);
  attempt.shards = s.number_of(3);
  attempt.worker = s.bytes_of(4);
  attempt.worker_name = s.bytes_of(5);
  attempt.purpose = static_cast<Purpose>(s.number_of(6));
  attempt.began_at_ms = s.signed_of(7);
  return attempt;
}

}  // namespace

std::vector<JobRecord> Journal::jobs(std::size_t ended_limit) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  std::vector<JobRecord> jobs;
  Statement unfinished(state_->connection,
                       select_jobs("WHERE ended_at_ms = 0 ORDER BY position").c_str());
  while (unfinished.step()) {
    jobs.push_back(job_of(unfinished));
  }
  Statement ended(state_->connection,
                  select_jobs("WHERE ended_at_ms <> 0 "
                              "ORDER BY ended_at_ms DESC, position DESC LIMIT ?")
                      .c_str());
  ended.number(ended_limit);
  while (ended.step()) {
    jobs.push_back(job_of(ended));
  }
  return jobs;
}

std::optional<JobRecord> Journal::job(const std::string& id) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection, select_jobs("WHERE id = ?").c_str());
  return s.text(id).step() ? std::optional(job_of(s)) : std::nullopt;
}

std::optional<JobRecord> Journal::job_of_request(const std::string& request_id) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection, select_jobs("WHERE request_id = ?").c_str());
  return s.text(request_id).step() ? std::optional(job_of(s)) : std::nullopt;
}

std::vector<std::optional<KeptResult>> Journal::results_of(std::span<const core::Digest> shards) {
  std::vector<std::optional<KeptResult>> results(shards.size());
  wait(append({}));
  // In the order of the table, so that each of its pages is read once.
  std::vector<std::size_t> order(shards.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return shards[a] < shards[b]; });
  for (std::size_t at = 0; at < order.size(); at += kLookupsAtOnce) {
    const std::lock_guard lock(state_->connection_mutex);
    Statement s(state_->connection,
                "SELECT result, worker, audited_by <> '' FROM results WHERE shard = ?");
    for (std::size_t i = at; i < std::min(at + kLookupsAtOnce, order.size()); ++i) {
      if (s.blob(shards[order[i]].binary()).step()) {
        results[order[i]] = KeptResult{s.digest_of(0), s.bytes_of(1), s.number_of(2) != 0};
      }
      s.reset();
    }
  }
  return results;
}

std::uint64_t Journal::forget_result(const core::Digest& result) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement(state_->connection, "DELETE FROM results WHERE result = ?")
      .blob(result.binary())
      .step();
  return state_->connection.changed_rows();
}

std::vector<FailureRecord> Journal::failures_of(const std::string& job, StageName stage) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection,
              "SELECT shard, worker, message, kind FROM failures WHERE job = ? AND stage = ?");
  s.text(job).number(static_cast<std::uint64_t>(stage));
  std::vector<FailureRecord> failures;
  while (s.step()) {
    failures.push_back({job, stage, s.number_of(0), s.bytes_of(1), s.bytes_of(2),
                        static_cast<TroubleKind>(s.number_of(3))});
  }
  return failures;
}

std::vector<AttemptRecord> Journal::running_attempts(const std::string& job, StageName stage) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection, (std::string("SELECT ") + kAttemptColumns +
                                   " FROM attempts WHERE job = ? AND stage = ? AND "
                                   "ended_at_ms = 0 ORDER BY attempt")
                                      .c_str());
  s.text(job).number(static_cast<std::uint64_t>(stage));
  std::vector<AttemptRecord> attempts;
  while (s.step()) {
    attempts.push_back(attempt_of(job, s));
  }
  return attempts;
}

std::vector<KeptAttempt> Journal::attempts_of(
    const std::string& job, std::size_t limit,
    const std::function<bool(const AttemptRecord&)>& wanted) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection, (std::string("SELECT ") + kAttemptColumns +
                                   " FROM attempts WHERE job = ? ORDER BY attempt DESC")
                                      .c_str());
  s.text(job);
  std::vector<KeptAttempt> attempts;
  while (attempts.size() < limit && s.step()) {
    KeptAttempt attempt;
    attempt.begin = attempt_of(job, s);
    if (!wanted(attempt.begin)) {
      continue;
    }
    if (s.signed_of(8) != 0) {
      attempt.end = AttemptEndRecord{job,
                                     attempt.begin.attempt,
                                     static_cast<Outcome>(s.number_of(9)),
                                     s.number_of(10),
                                     s.bytes_of(11),
                                     s.signed_of(8)};
    }
    attempt.taken_up = static_cast<std::uint32_t>(s.number_of(12));
    attempt.taken_up_at_ms = s.signed_of(13);
    attempt.earlier_outcome = static_cast<Outcome>(s.number_of(14));
    attempt.earlier_ended_at_ms = s.signed_of(15);
    attempts.push_back(std::move(attempt));
  }
  return attempts;
}

std::vector<MismatchRecord> Journal::mismatches_of(const std::string& job) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection,
              "SELECT stage, shard, worker, result, other_worker, other_result, liar "
              "FROM mismatches WHERE job = ? ORDER BY rowid");
  s.text(job);
  std::vector<MismatchRecord> mismatches;
  while (s.step()) {
    mismatches.push_back({job, static_cast<StageName>(s.number_of(0)), s.number_of(1),
                          s.bytes_of(2), s.digest_of(3), s.bytes_of(4), s.digest_of(5),
                          s.bytes_of(6)});
  }
  return mismatches;
}

std::vector<BlockRecord> Journal::blocks() {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection, "SELECT worker, stage, liar FROM blocks");
  std::vector<BlockRecord> blocks;
  while (s.step()) {
    blocks.push_back(
        {s.bytes_of(0), static_cast<StageName>(s.number_of(1)), true, s.number_of(2) != 0});
  }
  return blocks;
}

std::vector<std::string> Journal::drained() {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection, "SELECT worker FROM drains");
  std::vector<std::string> names;
  while (s.step()) {
    names.push_back(s.bytes_of(0));
  }
  return names;
}

std::vector<std::string> Journal::orders() {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection, "SELECT request_id FROM orders ORDER BY position");
  std::vector<std::string> ids;
  while (s.step()) {
    ids.push_back(s.bytes_of(0));
  }
  return ids;
}

}  // namespace weft::coordinator
