#include "worker/spool.h"

#include <algorithm>
#include <chrono>

#include <spdlog/spdlog.h>

#include "core/error.h"
#include "proto/limits.h"

namespace weft::worker {

namespace {

constexpr std::chrono::milliseconds kPoll{100};
constexpr std::chrono::milliseconds kGatherFor{250};
constexpr std::size_t kMuch = 64;  // results

v1::Completion name_of(const v1::Assignment& assignment) {
  v1::Completion name;
  name.set_job_id(assignment.name().job_id());
  name.set_attempt(assignment.name().attempt());
  name.set_lease_token(assignment.lease_token());
  return name;
}

}  // namespace

Spool::Spool(const std::filesystem::path& root, const std::string& name, std::uint64_t limit_bytes)
    : root_(root), limit_bytes_(limit_bytes) {
  folders_.push_back(std::make_unique<SpoolFolder>(SpoolFolder::make(root, name)));
}

Spool::~Spool() {
  for (const auto& folder : folders_) {
    if (folder->load().empty()) {
      folder->discard();
    }
  }
}

Spool::Entry& Spool::entry_of(const v1::Assignment& assignment) {
  const Name name{assignment.name().job_id(), assignment.name().attempt()};
  const auto found = entries_.find(name);
  if (found != entries_.end()) {
    return found->second;
  }
  const std::uint64_t number = next_number_++;
  folders_.front()->append(number, name_of(assignment));
  Entry& entry = entries_[name];
  entry.folder = folders_.front().get();
  entry.number = number;
  return entry;
}

bool Spool::put(const ShardClaim& claim, const core::Digest& digest, const std::string& bytes,
                const std::function<bool()>& should_stop) {
  SpoolItem item{claim, nullptr, 0, {claim.shard, digest, bytes.size()}};
  {
    std::unique_lock lock(mutex_);
    while (!is_closed_ && total_bytes_ >= limit_bytes_) {
      if (should_stop()) {
        return false;
      }
      changed_.wait_for(lock, kPoll);
    }
    if (is_closed_) {
      return false;
    }
    const Entry& entry = entry_of(claim.attempt->assignment);
    item.folder = entry.folder;
    item.number = entry.number;
    total_bytes_ += bytes.size();
  }
  try {
    item.folder->write(item.number, item.result, bytes);
  } catch (const core::Error&) {
    const std::lock_guard lock(mutex_);
    total_bytes_ -= bytes.size();
    changed_.notify_all();
    throw;
  }
  const std::lock_guard lock(mutex_);
  entry_of(claim.attempt->assignment).waiting[claim.shard] = item.result;
  items_.push_back(item);
  unsynced_.push_back(std::move(item));
  changed_.notify_all();
  return true;
}

std::vector<SpoolItem> Spool::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return is_closed_ || !items_.empty(); });
  changed_.wait_for(lock, kGatherFor, [&] {
    return is_closed_ || is_urgent_ || items_.size() >= kMuch ||
           total_bytes_ >= std::min<std::uint64_t>(limit_bytes_, v1::kChunkLimitBytes);
  });
  is_urgent_ = false;
  std::vector<SpoolItem> batch;
  std::uint64_t bytes = 0;
  while (!is_closed_ && !items_.empty()) {
    bytes += items_.front().result.size_bytes;
    if (!batch.empty() && bytes > v1::kChunkLimitBytes) {
      break;
    }
    batch.push_back(std::move(items_.front()));
    items_.pop_front();
  }
  return batch;
}

void Spool::hurry() {
  const std::lock_guard lock(mutex_);
  is_urgent_ = !items_.empty();
  changed_.notify_all();
}

std::string Spool::read(const SpoolItem& item) {
  return item.folder->read(item.number, item.result);
}

void Spool::uploaded(const SpoolItem& item) {
  v1::Completion fragment;
  v1::ShardResult& result = *fragment.add_results();
  result.set_shard(item.result.shard);
  result.set_digest(item.result.digest.binary());
  result.set_size_bytes(item.result.size_bytes);
  bool is_noted = true;
  try {
    item.folder->append(item.number, fragment);
  } catch (const core::Error& error) {
    // A successor would upload it again, and be told that it is there.
    is_noted = false;
    const v1::AttemptName& name = item.claim.attempt->assignment.name();
    spdlog::warn("job={} attempt={} shard={} event=not_noted error=\"{}\"", name.job_id(),
                 name.attempt(), item.result.shard, error.what());
  }
  end(item, is_noted);
}

void Spool::dropped(const SpoolItem& item) { end(item, true); }

void Spool::kept(const SpoolItem& item) { end(item, false); }

void Spool::end(const SpoolItem& item, bool is_gone) {
  if (is_gone) {
    item.folder->remove(item.number, item.result);
  }
  const std::lock_guard lock(mutex_);
  total_bytes_ -= item.result.size_bytes;
  const v1::AttemptName& name = item.claim.attempt->assignment.name();
  const auto found = entries_.find({name.job_id(), name.attempt()});
  if (is_gone && found != entries_.end()) {
    found->second.waiting.erase(item.result.shard);
  }
  changed_.notify_all();
}

void Spool::forget(const v1::AttemptName& name) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find({name.job_id(), name.attempt()});
  if (found == entries_.end()) {
    return;
  }
  SpoolFolder* const folder = found->second.folder;
  for (const auto& [shard, result] : found->second.waiting) {
    folder->remove(found->second.number, result);
  }
  folder->remove_attempt(found->second.number);
  entries_.erase(found);
  discard_if_empty(folder);
}

void Spool::discard_if_empty(const SpoolFolder* folder) {
  const bool is_ours = folder == folders_.front().get();
  const bool is_used = std::any_of(entries_.begin(), entries_.end(), [&](const auto& entry) {
    return entry.second.folder == folder;
  });
  if (is_ours || is_used) {
    return;
  }
  const auto found = std::find_if(folders_.begin(), folders_.end(),
                                  [&](const auto& candidate) { return candidate.get() == folder; });
  (*found)->discard();
  folders_.erase(found);
}

std::vector<Spool::Orphan> Spool::take_over() {
  std::vector<Orphan> orphans;
  for (SpoolFolder& claimed : SpoolFolder::claim_orphans(root_)) {
    const std::vector<SpoolFolder::Content> contents = claimed.load();
    if (contents.empty()) {
      claimed.discard();
      continue;
    }
    const std::lock_guard lock(mutex_);
    folders_.push_back(std::make_unique<SpoolFolder>(std::move(claimed)));
    SpoolFolder* const folder = folders_.back().get();
    for (const SpoolFolder::Content& content : contents) {
      Entry entry{folder, content.number, {}};
      Orphan orphan{content.completion, {}};
      for (const SpoolFolder::Result& result : content.results) {
        entry.waiting[result.shard] = result;
        orphan.items.push_back({{nullptr, result.shard}, folder, content.number, result});
      }
      entries_[{content.completion.job_id(), content.completion.attempt()}] = std::move(entry);
      orphans.push_back(std::move(orphan));
    }
  }
  return orphans;
}

void Spool::enter(const SpoolItem& item) {
  const std::lock_guard lock(mutex_);
  total_bytes_ += item.result.size_bytes;
  items_.push_back(item);
  changed_.notify_all();
}

void Spool::sync() {
  std::vector<SpoolItem> items;
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(unsynced_, [&](const SpoolItem& item) {
      const v1::AttemptName& name = item.claim.attempt->assignment.name();
      const auto found = entries_.find({name.job_id(), name.attempt()});
      return found == entries_.end() || !found->second.waiting.contains(item.result.shard);
    });
    items.swap(unsynced_);
  }
  for (const SpoolItem& item : items) {
    item.folder->sync(item.number, item.result);
  }
}

void Spool::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  changed_.notify_all();
}

}  // namespace weft::worker
