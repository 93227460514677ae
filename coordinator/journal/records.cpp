#include "coordinator/journal/records.h"

namespace weft::coordinator {

namespace {

// Jobs are pruned once in so many ends.
constexpr std::uint64_t kPruneInterval = 64;

std::uint64_t stored(std::int64_t value) { return static_cast<std::uint64_t>(value); }

template <class Enum>
std::uint64_t code_of(Enum value) {
  return static_cast<std::uint64_t>(value);
}

// Labels hold no spaces.
std::string joined(const std::vector<std::string>& labels) {
  std::string all;
  for (const std::string& label : labels) {
    all += (all.empty() ? "" : " ") + label;
  }
  return all;
}

}  // namespace

RecordWriter::RecordWriter(Connection& connection) : connection_(connection) {
  Statement s(connection_,
              "SELECT job, COUNT(*) FROM attempts WHERE ended_at_ms <> 0 GROUP BY job");
  while (s.step()) {
    ended_attempts_[s.bytes_of(0)] = s.number_of(1);
  }
}

void RecordWriter::write(const Record& record) {
  std::visit([&](const auto& r) { put(r); }, record);
}

void RecordWriter::put(const JobRecord& job) {
  Statement s(connection_,
              "INSERT INTO jobs(id, request_id, fabric, description, comment, fingerprint, "
              "submitted_at_ms, ended_at_ms, summary, user, priority, audit, labels, paused, "
              "retries) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  s.text(job.id).text(job.request_id).text(job.fabric).blob(job.description).text(job.comment);
  if (job.fingerprint) {
    s.blob(job.fingerprint->binary());
  } else {
    s.null();
  }
  s.number(stored(job.submitted_at_ms)).number(stored(job.ended_at_ms)).blob(job.summary);
  s.text(job.demands.user)
      .number(stored(job.demands.priority))
      .real(job.demands.audit)
      .text(joined(job.demands.labels))
      .number(job.is_paused ? 1 : 0)
      .number(job.retries)
      .step();
}

void RecordWriter::put(const JobEndRecord& end) {
  Statement(connection_, "UPDATE jobs SET ended_at_ms = ?, summary = ? WHERE id = ?")
      .number(stored(end.ended_at_ms))
      .blob(end.summary)
      .text(end.job)
      .step();
  Statement(connection_,
            "UPDATE attempts SET ended_at_ms = ?, outcome = ? WHERE job = ? AND ended_at_ms = 0")
      .number(stored(end.ended_at_ms))
      .number(code_of(Outcome::kStopped))
      .text(end.job)
      .step();
  ended_attempts_[end.job] += connection_.changed_rows();
  forget_failures(end.job);
  prune_attempts(end.job);
  if (++ends_since_pruning_ >= kPruneInterval) {
    ends_since_pruning_ = 0;
    prune_jobs();
  }
}

void RecordWriter::put(const RetryRecord& retry) {
  Statement(connection_,
            "UPDATE jobs SET ended_at_ms = 0, summary = x'', paused = 0, retries = retries + 1 "
            "WHERE id = ?")
      .text(retry.job)
      .step();
  forget_failures(retry.job);
  forget_mismatches(retry.job);
}

void RecordWriter::put(const PauseRecord& pause) {
  Statement(connection_, "UPDATE jobs SET paused = ? WHERE id = ?")
      .number(pause.is_paused ? 1 : 0)
      .text(pause.job)
      .step();
}

void RecordWriter::put(const PriorityRecord& priority) {
  Statement(connection_, "UPDATE jobs SET priority = ? WHERE id = ?")
      .number(stored(priority.priority))
      .text(priority.job)
      .step();
}

void RecordWriter::put(const DrainRecord& drain) {
  Statement(connection_, drain.is_drained ? "INSERT OR IGNORE INTO drains(worker) VALUES(?)"
                                          : "DELETE FROM drains WHERE worker = ?")
      .text(drain.worker)
      .step();
}

void RecordWriter::put(const OrderRecord& order) {
  Statement(connection_, "INSERT OR IGNORE INTO orders(request_id) VALUES(?)")
      .text(order.request_id)
      .step();
  Statement(connection_,
            "DELETE FROM orders WHERE position <= (SELECT MAX(position) FROM orders) - ?")
      .number(kOrdersKept)
      .step();
}

void RecordWriter::put(const BindRecord& bind) {
  Statement(connection_, "UPDATE jobs SET fingerprint = ? WHERE id = ?")
      .blob(bind.fingerprint.binary())
      .text(bind.job)
      .step();
}

void RecordWriter::put(const ResultRecord& result) {
  Statement(connection_,
            "INSERT OR REPLACE INTO results(shard, result, size_bytes, worker) VALUES(?, ?, ?, ?)")
      .blob(result.shard.binary())
      .blob(result.result.binary())
      .number(result.size_bytes)
      .text(result.worker)
      .step();
}

void RecordWriter::put(const ResultDropRecord& drop) {
  Statement(connection_, "DELETE FROM results WHERE shard = ? AND result = ?")
      .blob(drop.shard.binary())
      .blob(drop.result.binary())
      .step();
}

void RecordWriter::put(const AuditRecord& audit) {
  Statement(connection_, "UPDATE results SET audited_by = ? WHERE shard = ?")
      .text(audit.worker)
      .blob(audit.shard.binary())
      .step();
}

void RecordWriter::put(const FailureRecord& failure) {
  Statement(connection_,
            "INSERT INTO failures(job, stage, shard, worker, message, kind) "
            "VALUES(?, ?, ?, ?, ?, ?)")
      .text(failure.job)
      .number(code_of(failure.stage))
      .number(failure.shard)
      .text(failure.worker)
      .text(failure.message)
      .number(code_of(failure.kind))
      .step();
}

void RecordWriter::put(const FailuresDropRecord& drop) {
  Statement(connection_, "DELETE FROM failures WHERE job = ? AND stage = ? AND worker = ?")
      .text(drop.job)
      .number(code_of(drop.stage))
      .text(drop.worker)
      .step();
}

void RecordWriter::put(const BlockRecord& block) {
  Statement(connection_, "DELETE FROM blocks WHERE worker = ? AND stage = ?")
      .text(block.worker)
      .number(code_of(block.stage))
      .step();
  if (block.is_blocked) {
    Statement(connection_, "INSERT INTO blocks(worker, stage, liar) VALUES(?, ?, ?)")
        .text(block.worker)
        .number(code_of(block.stage))
        .number(block.is_liar ? 1 : 0)
        .step();
  }
}

void RecordWriter::put(const AttemptRecord& attempt) {
  Statement(connection_,
            "INSERT OR IGNORE INTO attempts(job, attempt, stage, first_shard, shards, worker, "
            "worker_name, purpose, began_at_ms) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)")
      .text(attempt.job)
      .number(attempt.attempt)
      .number(code_of(attempt.stage))
      .number(attempt.first_shard)
      .number(attempt.shards)
      .text(attempt.worker)
      .text(attempt.worker_name)
      .number(code_of(attempt.purpose))
      .number(stored(attempt.began_at_ms))
      .step();
  if (connection_.changed_rows() == 0) {
    take_up(attempt);
  }
}

// The attempt is there: where it has ended, it goes on. How it had ended stays.
void RecordWriter::take_up(const AttemptRecord& attempt) {
  Statement(connection_,
            "UPDATE attempts SET worker = ?, worker_name = ?, taken_up = taken_up + 1, "
            "taken_up_at_ms = ?, earlier_outcome = outcome, earlier_ended_at_ms = ended_at_ms, "
            "ended_at_ms = 0, outcome = 0, shards_done = 0, message = '' "
            "WHERE job = ? AND attempt = ? AND ended_at_ms <> 0")
      .text(attempt.worker)
      .text(attempt.worker_name)
      .number(stored(attempt.began_at_ms))
      .text(attempt.job)
      .number(attempt.attempt)
      .step();
  ended_attempts_[attempt.job] -= connection_.changed_rows();
}

void RecordWriter::put(const AttemptEndRecord& end) {
  Statement(connection_,
            "UPDATE attempts SET ended_at_ms = ?, outcome = ?, shards_done = ?, message = ? "
            "WHERE job = ? AND attempt = ?")
      .number(stored(end.ended_at_ms))
      .number(code_of(end.outcome))
      .number(end.shards_done)
      .text(end.message)
      .text(end.job)
      .number(end.attempt)
      .step();
  if (++ended_attempts_[end.job] >= kEndedAttemptsLimit + kEndedAttemptsLimit / 4) {
    prune_attempts(end.job);
  }
}

void RecordWriter::put(const MismatchRecord& mismatch) {
  // Said again when the liar is known, and then the liar is added.
  Statement(connection_,
            "DELETE FROM mismatches WHERE job = ? AND stage = ? AND shard = ? AND liar = ''")
      .text(mismatch.job)
      .number(code_of(mismatch.stage))
      .number(mismatch.shard)
      .step();
  Statement(connection_,
            "INSERT INTO mismatches(job, stage, shard, worker, result, other_worker, "
            "other_result, liar) VALUES(?, ?, ?, ?, ?, ?, ?, ?)")
      .text(mismatch.job)
      .number(code_of(mismatch.stage))
      .number(mismatch.shard)
      .text(mismatch.worker)
      .blob(mismatch.result.binary())
      .text(mismatch.other_worker)
      .blob(mismatch.other_result.binary())
      .text(mismatch.liar)
      .step();
}

void RecordWriter::forget_failures(const std::string& job) {
  Statement(connection_, "DELETE FROM failures WHERE job = ?").text(job).step();
}

void RecordWriter::forget_mismatches(const std::string& job) {
  Statement(connection_, "DELETE FROM mismatches WHERE job = ?").text(job).step();
}

void RecordWriter::prune_attempts(const std::string& job) {
  std::uint64_t& count = ended_attempts_[job];
  if (count <= kEndedAttemptsLimit) {
    return;
  }
  Statement(connection_,
            "DELETE FROM attempts WHERE job = ?1 AND ended_at_ms <> 0 AND attempt <= "
            "(SELECT attempt FROM attempts WHERE job = ?1 AND ended_at_ms <> 0 "
            "ORDER BY attempt DESC LIMIT 1 OFFSET ?2)")
      .text(job)
      .number(kEndedAttemptsLimit)
      .step();
  count -= connection_.changed_rows();
}

void RecordWriter::prune_jobs() {
  // More than have ended since the last time, so that those before were pruned then.
  std::vector<std::string> jobs;
  {
    Statement older(connection_,
                    "SELECT id FROM jobs WHERE ended_at_ms <> 0 "
                    "ORDER BY ended_at_ms DESC, position DESC LIMIT ? OFFSET ?");
    older.number(4 * kPruneInterval).number(kAttemptJobsLimit);
    while (older.step()) {
      jobs.push_back(older.bytes_of(0));
    }
  }
  for (const std::string& job : jobs) {
    Statement(connection_, "DELETE FROM attempts WHERE job = ?").text(job).step();
    forget_mismatches(job);
    ended_attempts_.erase(job);
  }
  Statement(connection_,
            "DELETE FROM jobs WHERE id IN (SELECT id FROM jobs WHERE ended_at_ms <> 0 "
            "ORDER BY ended_at_ms DESC, position DESC LIMIT -1 OFFSET ?)")
      .number(kEndedJobsKept)
      .step();
}

}  // namespace weft::coordinator
