#include <algorithm>
#include <chrono>
#include <cmath>
#include <new>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/error.h"
#include "proto/limits.h"
#include "worker/back_off.h"
#include "worker/lease_loop.h"

// The worker's threads that compute shards and store their results.

namespace weft::worker {

namespace {

constexpr std::chrono::milliseconds kLongestUndelivered{15'000};

std::uint64_t whole_ms(double seconds) {
  return static_cast<std::uint64_t>(std::llround(seconds * 1000));
}

v1::ErrorKind kind_of(const core::Error& error) {
  // Inputs that cannot be had are a shortage, not a fault of the task.
  const bool is_short = error.code() == core::Code::kUnavailable ||
                        error.code() == core::Code::kResourceExhausted ||
                        error.code() == core::Code::kNotFound;
  return is_short ? v1::ERROR_KIND_RESOURCE_SHORT : v1::ERROR_KIND_TASK_FAILED;
}

const char* name_of(v1::ErrorKind kind) {
  return kind == v1::ERROR_KIND_RESOURCE_SHORT ? "resource_short" : "task_failed";
}

}  // namespace

void LeaseLoop::compute(Seat& seat) {
  while (const std::optional<ShardClaim> claim = next_claim(seat)) {
    bake(seat, *claim);
  }
}

std::optional<ShardClaim> LeaseLoop::next_claim(Seat& seat) {
  std::optional<ShardClaim> claim;
  bool has_room = false;
  {
    std::unique_lock lock(mutex_);
    while (!is_leaving_.load() && !(claim = table_.claim())) {
      spool_.hurry();
      changed_.wait(lock);
    }
    if (!claim) {
      return std::nullopt;
    }
    if (!claim->attempt->since_first_shard) {
      claim->attempt->since_first_shard.emplace();
    }
    seat.claim = claim;
    has_room = table_.free_attempts() > free_told_;
  }
  if (has_room) {
    tell_news();
  }
  return claim;
}

// Puts down what the seat has in hand; false when that was taken away meanwhile.
bool LeaseLoop::leave(Seat& seat) {
  const std::lock_guard lock(mutex_);
  const bool was_given_up = seat.is_given_up;
  if (was_given_up) {
    --stuck_;
    spdlog::warn("worker={} {} shard={} state=returned: a thread that hung is back", id_,
                 log_name(*seat.claim->attempt), seat.claim->shard);
  }
  seat = Seat();
  return !was_given_up;
}

void LeaseLoop::bake(Seat& seat, const ShardClaim& claim) {
  Attempt& attempt = *claim.attempt;
  const auto should_stop = [&attempt, this] {
    attempt.progress.fetch_add(1);
    return attempt.should_stop.load() || is_giving_up_.load();
  };
  Baked result;
  std::optional<v1::ErrorKind> error;
  std::string message;
  bool is_cancelled = false;
  try {
    result = baked(claim, should_stop);
  } catch (const core::Error& e) {
    is_cancelled = e.code() == core::Code::kCancelled;
    error = kind_of(e);
    message = e.what();
  } catch (const std::bad_alloc&) {
    error = v1::ERROR_KIND_RESOURCE_SHORT;
    message = "out of memory";
  } catch (const std::exception& e) {
    error = v1::ERROR_KIND_TASK_FAILED;
    message = e.what();
  }
  if (!leave(seat)) {
    return;
  }
  if (is_cancelled) {
    give_up(claim);
  } else if (error) {
    fail(claim, *error, message);
  } else {
    store(claim, result, should_stop);
  }
}

LeaseLoop::Baked LeaseLoop::baked(const ShardClaim& claim,
                                  const std::function<bool()>& should_stop) {
  Attempt& attempt = *claim.attempt;
  const v1::Assignment& assignment = attempt.assignment;
  const StageBakers::Prepared prepared = bakers_.of(assignment, should_stop);
  if (prepared.prepare_seconds > 0) {
    attempt.log.add(fmt::format("stage prepared in {:.2f} s", prepared.prepare_seconds));
  }
  std::string shard_input;
  if (!assignment.shard_inputs().empty()) {
    const auto index = static_cast<int>(claim.shard - assignment.first_shard());
    shard_input =
        blobs_.read(*core::Digest::from_binary(assignment.shard_inputs(index)), should_stop);
  }
  const core::Stopwatch since_start;
  Baked baked;
  baked.bytes = prepared.baker->bake(claim.shard, shard_input, should_stop);
  baked.seconds = since_start.seconds();
  const std::lock_guard lock(mutex_);
  attempt.prepare_ms += whole_ms(prepared.prepare_seconds);
  const std::uint64_t wall_ms = whole_ms(attempt.since_first_shard->seconds());
  attempt.work_ms = wall_ms - std::min(wall_ms, attempt.prepare_ms);
  return baked;
}

void LeaseLoop::store(const ShardClaim& claim, const Baked& baked,
                      const std::function<bool()>& should_stop) {
  const core::Digest digest = core::digest_of(baked.bytes);
  spdlog::debug("worker={} job={} attempt={} shard={} digest={} seconds={:.3f} state=computed", id_,
                claim.attempt->assignment.name().job_id(),
                claim.attempt->assignment.name().attempt(), claim.shard, digest.hex(),
                baked.seconds);
  claim.attempt->log.add_sometimes(fmt::format("shard {} computed in {:.3f} s, {} bytes",
                                               claim.shard, baked.seconds, baked.bytes.size()));
  try {
    if (!spool_.put(claim, digest, baked.bytes, should_stop)) {
      give_up(claim);
    }
  } catch (const core::Error& error) {
    fail(claim, kind_of(error), error.what());
  }
}

void LeaseLoop::give_up(const ShardClaim& claim) {
  {
    const std::lock_guard lock(mutex_);
    table_.given_up(claim);
    changed_.notify_all();
  }
  if (!is_giving_up_.load()) {
    forget_what_is_over();
  }
}

void LeaseLoop::fail(const ShardClaim& claim, v1::ErrorKind kind, const std::string& message) {
  spdlog::error("worker={} {} shard={} state=failed kind={} error=\"{}\"", id_,
                log_name(*claim.attempt), claim.shard, name_of(kind), message);
  claim.attempt->log.add_important(
      fmt::format("error: shard {}: {}: {}", claim.shard, name_of(kind), message));
  v1::TaskError error;
  error.set_kind(kind);
  error.set_shard(claim.shard);
  error.set_message(std::string(beginning_of(printable(message), v1::kErrorTextLimitBytes)));
  bool is_over = false;
  {
    const std::lock_guard lock(mutex_);
    is_over = table_.failed(claim, std::move(error));
  }
  if (is_over) {
    logs_.hurry();
    tell_news();
    forget_what_is_over();
  }
}

void LeaseLoop::upload() {
  while (true) {
    std::vector<SpoolItem> items = spool_.next();
    if (items.empty()) {
      return;
    }
    upload(std::move(items));
  }
}

// Those whose bytes are as they were computed; the others have failed.
std::vector<BlobClient::Blob> LeaseLoop::read_spooled(std::vector<SpoolItem>& items) {
  std::vector<BlobClient::Blob> blobs;
  std::erase_if(items, [&](const SpoolItem& item) {
    try {
      blobs.push_back({item.result.digest, Spool::read(item)});
      return false;
    } catch (const core::Error& error) {
      drop(item, error);
      return true;
    }
  });
  return blobs;
}

// Gives results to the coordinator. Those that it has no room for have cost time: they stay in the
// scratch folder until there is room, and nothing more is asked for meanwhile.
void LeaseLoop::deliver(const std::vector<BlobClient::Blob>& blobs) {
  const auto should_stop = [this] { return is_giving_up_.load(); };
  BackOff back_off(kLongestUndelivered);
  while (true) {
    try {
      blobs_.write(blobs, should_stop);
      set_undelivered("");
      return;
    } catch (const core::Error& error) {
      const bool has_no_room = error.code() == core::Code::kResourceExhausted;
      if (!has_no_room || blobs.front().data.size() > v1::kBlobLimitBytes) {
        throw;
      }
      set_undelivered(error.what());
    }
    back_off.wait(should_stop);
  }
}

void LeaseLoop::set_undelivered(const std::string& why) {
  bool is_news = false;
  {
    const std::lock_guard lock(mutex_);
    is_news =
        table_.set_undelivered(std::string(beginning_of(printable(why), v1::kErrorTextLimitBytes)));
  }
  if (!is_news) {
    return;
  }
  if (why.empty()) {
    spdlog::info("worker={} event=delivers_again", id_);
  } else {
    spdlog::warn("worker={} event=cannot_deliver error=\"{}\"", id_, why);
  }
  tell_news();
}

void LeaseLoop::drop(const SpoolItem& item, const core::Error& why) {
  spool_.dropped(item);
  fail(item.claim, v1::ERROR_KIND_RESOURCE_SHORT, why.what());
}

void LeaseLoop::upload(std::vector<SpoolItem> items) {
  const std::vector<BlobClient::Blob> blobs = read_spooled(items);
  if (blobs.empty()) {
    return;
  }
  try {
    deliver(blobs);
  } catch (const core::Error& error) {
    for (const SpoolItem& item : items) {
      if (error.code() == core::Code::kCancelled) {
        spool_.kept(item);
      } else {
        drop(item, error);
      }
    }
    return;
  }
  for (const SpoolItem& item : items) {
    note_uploaded(item);
  }
}

void LeaseLoop::note_uploaded(const SpoolItem& item) {
  spool_.uploaded(item);
  v1::ShardResult result;
  result.set_shard(item.claim.shard);
  result.set_digest(item.result.digest.binary());
  result.set_size_bytes(item.result.size_bytes);
  bool is_over = false;
  {
    const std::lock_guard lock(mutex_);
    is_over = table_.delivered(item.claim, std::move(result));
  }
  if (is_over) {
    Attempt& attempt = *item.claim.attempt;
    spdlog::info("worker={} {} results={} prepare_ms={} work_ms={} state=completed", id_,
                 log_name(attempt), attempt.results.size(), attempt.prepare_ms, attempt.work_ms);
    attempt.log.add(fmt::format("ended: {} of {} shards in {:.3f} s, of which {:.3f} s preparing",
                                attempt.results.size(), attempt.assignment.shards(),
                                1e-3 * static_cast<double>(attempt.work_ms + attempt.prepare_ms),
                                1e-3 * static_cast<double>(attempt.prepare_ms)));
    logs_.hurry();
    tell_news();
  }
}

}  // namespace weft::worker
