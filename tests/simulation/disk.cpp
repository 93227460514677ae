#include "tests/simulation/disk.h"

#include <iterator>

#include "core/check.h"

namespace weft::simulation {

namespace {

using namespace coordinator;

struct Apply {
  Tables& tables;

  void operator()(const JobRow& row) const { tables.jobs[row.id] = row; }
  void operator()(const JobEndRow& row) const {
    JobRow& job = tables.jobs.at(row.job);
    job.end = row.end;
    job.error = row.error;
    job.database = row.database;
    std::erase_if(tables.attempts, [&](const auto& a) { return a.second.job == row.job; });
  }
  void operator()(const PauseRow& row) const { tables.jobs.at(row.job).is_paused = row.is_paused; }
  void operator()(const PriorityRow& row) const {
    tables.jobs.at(row.job).demands.priority = row.priority;
  }
  void operator()(const DrainRow& row) const {
    if (row.is_drained) {
      tables.drained.insert(row.worker);
    } else {
      tables.drained.erase(row.worker);
    }
  }
  void operator()(const RetryRow& row) const {
    JobRow& job = tables.jobs.at(row.job);
    job.end = End::kNone;
    job.error.clear();
    job.is_paused = false;
    std::erase_if(tables.failures, [&](const FailureRecord& f) { return f.job == row.job; });
    std::erase_if(tables.mismatches, [&](const MismatchRecord& m) { return m.job == row.job; });
  }
  void operator()(const ForgetRow& row) const {
    std::erase_if(tables.results, [&](const auto& r) { return r.second.result == row.result; });
  }
  void operator()(const BindRecord& row) const {
    tables.jobs.at(row.job).fingerprint = row.fingerprint;
  }
  void operator()(const ResultRecord& row) const {
    tables.results[row.shard] = {row.result, row.worker, false};
  }
  void operator()(const ResultDropRecord& row) const {
    const auto found = tables.results.find(row.shard);
    if (found != tables.results.end() && found->second.result == row.result) {
      tables.results.erase(found);
    }
  }
  void operator()(const AuditRecord& row) const {
    const auto found = tables.results.find(row.shard);
    if (found != tables.results.end()) {
      found->second.is_audited = true;
    }
  }
  void operator()(const FailureRecord& row) const { tables.failures.push_back(row); }
  void operator()(const FailuresDropRecord& row) const {
    std::erase_if(tables.failures, [&](const FailureRecord& failure) {
      return failure.job == row.job && failure.stage == row.stage && failure.worker == row.worker;
    });
  }
  void operator()(const BlockRecord& row) const {
    if (row.is_blocked) {
      tables.blocks[{row.worker, row.stage}] = row.is_liar;
    } else {
      tables.blocks.erase({row.worker, row.stage});
    }
  }
  void operator()(const AttemptRecord& row) const {
    tables.attempts[row.attempt] = row;
    tables.lost.erase(row.attempt);
  }
  void operator()(const AttemptEndRecord& row) const {
    const auto begun = tables.attempts.find(row.attempt);
    if (begun != tables.attempts.end() && row.outcome == Outcome::kLost) {
      tables.lost[row.attempt] = {begun->second, row.ended_at_ms};
    }
    tables.attempts.erase(row.attempt);
  }
  void operator()(const MismatchRecord& row) const {
    std::erase_if(tables.mismatches, [&](const MismatchRecord& open) {
      return open.job == row.job && open.stage == row.stage && open.shard == row.shard &&
             open.liar.empty();
    });
    tables.mismatches.push_back(row);
  }
};

}  // namespace

void Tables::apply(const Row& row) { std::visit(Apply{*this}, row); }

std::vector<MismatchRecord> Tables::mismatches_of(const std::string& job) const {
  std::vector<MismatchRecord> found;
  for (const MismatchRecord& mismatch : mismatches) {
    if (mismatch.job == job) {
      found.push_back(mismatch);
    }
  }
  return found;
}

std::uint64_t JournalDisk::append(std::vector<Row> rows) {
  if (rows.empty()) {
    return last_ticket_;
  }
  for (const Row& row : rows) {
    tables_.apply(row);
  }
  waiting_.push_back(std::move(rows));
  return ++last_ticket_;
}

void JournalDisk::begin_sync() {
  CHECK(!is_syncing_);
  is_syncing_ = true;
  for (std::vector<Row>& rows : waiting_) {
    std::move(rows.begin(), rows.end(), std::back_inserter(under_way_));
  }
  waiting_.clear();
  ticket_under_way_ = last_ticket_;
}

void JournalDisk::end_sync() {
  CHECK(is_syncing_);
  is_syncing_ = false;
  for (const Row& row : under_way_) {
    durable_.apply(row);
  }
  under_way_.clear();
  durable_ticket_ = ticket_under_way_;
}

void JournalDisk::add_version(const std::string& fabric, const core::Digest& database) {
  tables_.versions.emplace_back(fabric, database);
  durable_.versions.emplace_back(fabric, database);
}

std::uint32_t JournalDisk::count_start() { return tables_.epoch = ++durable_.epoch; }

void JournalDisk::crash(bool keeps_group_under_way) {
  if (is_syncing_ && keeps_group_under_way) {
    end_sync();
  }
  is_syncing_ = false;
  under_way_.clear();
  waiting_.clear();
  durable_ticket_ = last_ticket_;  // nobody waits any more
  tables_ = durable_;
}

std::optional<std::string> BlobDisk::get(const core::Digest& digest) {
  const auto found = blobs_.find(digest);
  if (found == blobs_.end()) {
    return std::nullopt;
  }
  if (core::digest_of(found->second) != digest) {
    blobs_.erase(found);
    return std::nullopt;
  }
  return found->second;
}

std::optional<core::Digest> BlobDisk::spoil(std::uint64_t which, bool removes_it) {
  if (blobs_.empty()) {
    return std::nullopt;
  }
  const auto blob = std::next(blobs_.begin(), static_cast<std::ptrdiff_t>(which % blobs_.size()));
  const core::Digest digest = blob->first;
  if (removes_it) {
    blobs_.erase(blob);
  } else {
    blob->second.front() ^= 1;
  }
  return digest;
}

}  // namespace weft::simulation
