#include <algorithm>
#include <new>
#include <optional>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/error.h"
#include "proto/limits.h"
#include "worker/baker.h"
#include "worker/lease_loop.h"

// The worker's threads that compute shards and store their results.

namespace weft::worker {

namespace {

std::uint64_t whole_ms(double seconds) { return static_cast<std::uint64_t>(seconds * 1000 + 0.5); }

}  // namespace

void LeaseLoop::compute() {
  while (true) {
    std::optional<ShardClaim> claim;
    bool has_room = false;
    {
      std::unique_lock lock(mutex_);
      while (!is_leaving_.load() && !(claim = table_.claim())) {
        changed_.wait(lock);
      }
      if (!claim) {
        return;
      }
      if (!claim->attempt->since_first_shard) {
        claim->attempt->since_first_shard.emplace();
      }
      has_room = table_.free_attempts() > free_told_;
    }
    if (has_room) {
      tell_news();
    }
    bake(*claim);
  }
}

void LeaseLoop::bake(const ShardClaim& claim) {
  Attempt& attempt = *claim.attempt;
  const v1::Assignment& assignment = attempt.assignment;
  const auto should_stop = [&attempt, this] {
    return attempt.should_stop.load() || is_giving_up_.load();
  };
  try {
    const StageBakers::Prepared prepared = bakers_.of(assignment, should_stop);
    std::string shard_input;
    if (!assignment.shard_inputs().empty()) {
      const auto index = static_cast<int>(claim.shard - assignment.first_shard());
      shard_input =
          blobs_.read(*core::Digest::from_binary(assignment.shard_inputs(index)), should_stop);
    }
    std::string result = prepared.baker->bake(claim.shard, shard_input, should_stop);
    {
      const std::lock_guard lock(mutex_);
      attempt.prepare_ms += whole_ms(prepared.prepare_seconds);
      const std::uint64_t wall_ms = whole_ms(attempt.since_first_shard->seconds());
      attempt.work_ms = wall_ms - std::min(wall_ms, attempt.prepare_ms);
    }
    const core::Digest digest = core::digest_of(result);
    if (outbox_.push({claim, digest, std::move(result)})) {
      return;
    }
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kCancelled) {
      // Inputs that cannot be had are a shortage, not a fault of the task.
      const bool is_short = error.code() == core::Code::kUnavailable ||
                            error.code() == core::Code::kResourceExhausted ||
                            error.code() == core::Code::kNotFound;
      fail(claim, is_short ? v1::ERROR_KIND_RESOURCE_SHORT : v1::ERROR_KIND_TASK_FAILED,
           error.what());
      return;
    }
  } catch (const std::bad_alloc&) {
    fail(claim, v1::ERROR_KIND_RESOURCE_SHORT, "out of memory");
    return;
  } catch (const std::exception& error) {
    fail(claim, v1::ERROR_KIND_TASK_FAILED, error.what());
    return;
  }
  const std::lock_guard lock(mutex_);
  table_.given_up(claim);
  changed_.notify_all();
}

void LeaseLoop::fail(const ShardClaim& claim, v1::ErrorKind kind, const std::string& message) {
  spdlog::error("worker={} {} shard={} state=failed kind={} error=\"{}\"", id_,
                log_name(*claim.attempt), claim.shard,
                kind == v1::ERROR_KIND_RESOURCE_SHORT ? "resource_short" : "task_failed", message);
  v1::TaskError error;
  error.set_kind(kind);
  error.set_shard(claim.shard);
  error.set_message(message.substr(0, v1::kErrorTextLimitBytes));
  bool is_over = false;
  {
    const std::lock_guard lock(mutex_);
    is_over = table_.failed(claim, std::move(error));
  }
  if (is_over) {
    tell_news();
  }
}

void LeaseLoop::upload() {
  while (const std::optional<OutboxItem> item = outbox_.pop()) {
    upload(*item);
  }
}

void LeaseLoop::upload(const OutboxItem& item) {
  try {
    blobs_.write(item.digest, item.bytes, [this] { return is_giving_up_.load(); });
  } catch (const core::Error& error) {
    if (error.code() == core::Code::kCancelled) {
      const std::lock_guard lock(mutex_);
      table_.given_up(item.claim);
    } else {
      fail(item.claim, v1::ERROR_KIND_RESOURCE_SHORT, error.what());
    }
    return;
  }
  v1::ShardResult result;
  result.set_shard(item.claim.shard);
  result.set_digest(item.digest.binary());
  result.set_size_bytes(item.bytes.size());
  bool is_over = false;
  {
    const std::lock_guard lock(mutex_);
    is_over = table_.delivered(item.claim, std::move(result));
  }
  if (is_over) {
    const Attempt& attempt = *item.claim.attempt;
    spdlog::info("worker={} {} results={} prepare_ms={} work_ms={} state=completed", id_,
                 log_name(attempt), attempt.results.size(), attempt.prepare_ms, attempt.work_ms);
    tell_news();
  }
}

}  // namespace weft::worker
