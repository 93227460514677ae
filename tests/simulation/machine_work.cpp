#include <algorithm>

#include "core/check.h"
#include "tests/simulation/machine.h"

// The threads of a worker: shards are claimed, computed and delivered.

namespace weft::simulation {

namespace {

constexpr std::uint64_t kCallTimeoutMs = 30'000;

// How long a shard of that stage takes on one thread of a machine that is not slow.
std::uint64_t shard_ms(const core::Digest& work) {
  constexpr std::uint64_t kTimes[] = {50, 100, 300, 700, 1'500, 4'000};
  return kTimes[work.bytes[0] % 6];
}

std::vector<core::Digest> digests_of(
    const google::protobuf::RepeatedPtrField<std::string>& digests) {
  std::vector<core::Digest> list;
  for (const std::string& digest : digests) {
    list.push_back(*core::Digest::from_binary(digest));
  }
  return list;
}

}  // namespace

core::Digest Machine::work_of_claim(const worker::ShardClaim& claim) const {
  const v1::Assignment& assignment = claim.attempt->assignment;
  std::optional<core::Digest> shard_input;
  if (!assignment.shard_inputs().empty()) {
    const auto index = static_cast<int>(claim.shard - assignment.first_shard());
    shard_input = core::Digest::from_binary(assignment.shard_inputs(index));
  }
  return work_of(assignment.spec().geometry().description().name(), digests_of(assignment.inputs()),
                 shard_input, claim.shard, character_.fingerprint);
}

const BadShard* Machine::bad_shard(const worker::ShardClaim& claim) const {
  const v1::Assignment& assignment = claim.attempt->assignment;
  const auto found = std::find_if(bad_shards_.begin(), bad_shards_.end(), [&](const BadShard& bad) {
    return bad.shard == claim.shard && bad.stage == assignment.stage() &&
           assignment.fabric().starts_with(bad.cloth + ".");
  });
  return found == bad_shards_.end() ? nullptr : &*found;
}

void Machine::work() {
  Process& process = *process_;
  while (process.busy < character_.threads) {
    const std::optional<worker::ShardClaim> claim = process.table.claim();
    if (!claim) {
      break;
    }
    ++process.busy;
    checks_.computed(claim->attempt->assignment.name().attempt(), claim->shard);
    prepare(*claim, 0);
  }
  if (process.table.free_attempts() > process.free_told) {
    tell_news();
  }
}

// Reads the inputs that the process does not hold yet.
void Machine::prepare(const worker::ShardClaim& claim, std::uint64_t tries) {
  const v1::Assignment& assignment = claim.attempt->assignment;
  std::vector<std::string> missing;
  for (const std::string& input : assignment.inputs()) {
    if (!process_->inputs.contains(input)) {
      missing.push_back(input);
    }
  }
  if (!assignment.shard_inputs().empty()) {
    const auto index = static_cast<int>(claim.shard - assignment.first_shard());
    missing.push_back(assignment.shard_inputs(index));
  }
  if (missing.empty()) {
    bake(claim);
    return;
  }
  if (claim.attempt->should_stop.load()) {
    give_up(claim);
    return;
  }
  const auto is_settled = std::make_shared<bool>(false);  // the first answer counts
  const auto again = [this, claim, tries, is_settled] {
    if (!std::exchange(*is_settled, true)) {
      later(std::min<std::uint64_t>(5'000, 100 << std::min<std::uint64_t>(tries, 6)),
            [this, claim, tries] { prepare(claim, tries + 1); });
    }
  };
  const auto read = [this, life = life_, claim, missing, is_settled] {
    bool is_complete = true;
    for (const std::string& input : missing) {
      is_complete = coordinator_.read_blob(*core::Digest::from_binary(input)) && is_complete;
      if (!coordinator_.is_up()) {
        return;
      }
    }
    ground_.carry([this, life, claim, missing, is_settled, is_complete] {
      run_alive(life, [this, claim, missing, is_settled, is_complete] {
        if (is_cut_off() || std::exchange(*is_settled, true)) {
          return;
        }
        if (is_complete) {
          process_->inputs.insert(missing.begin(), missing.end());
          bake(claim);
        } else {
          fail(claim, v1::ERROR_KIND_RESOURCE_SHORT, "an input is not there");
          thread_is_free();
        }
      });
    });
  };
  call_coordinator(read, again);
  later(kCallTimeoutMs, again);
}

void Machine::bake(const worker::ShardClaim& claim) {
  const BadShard* const bad = bad_shard(claim);
  if (bad != nullptr && bad->kills) {
    later(ground_.between(50, 500), [this] { kill(); });
    return;
  }
  if (ground_.happens(ground_.weather.hung_shards)) {
    ground_.say("{} hangs in {} shard {}", worker_id(), worker::log_name(*claim.attempt),
                claim.shard);
    const auto poll = std::make_shared<std::function<void()>>();
    *poll = [this, claim, weak = std::weak_ptr(poll)] {
      if (claim.attempt->should_stop.load()) {
        give_up(claim);
      } else if (const auto self = weak.lock()) {
        later(500, [self] { (*self)(); });
      }
    };
    (*poll)();
    return;
  }
  const std::uint64_t takes_ms =
      shard_ms(work_of_claim(claim)) * character_.slowness * ground_.between(80, 120) / 100;
  later(takes_ms, [this, claim, takes_ms] {
    claim.attempt->work_ms += takes_ms / std::max(1U, character_.threads) + 1;
    finish(claim);
  });
}

void Machine::finish(const worker::ShardClaim& claim) {
  if (claim.attempt->should_stop.load() && ground_.happens(0.5)) {
    give_up(claim);  // it looked, and was told to stop
    return;
  }
  const std::string& stage = claim.attempt->assignment.stage();
  const BadShard* const bad = bad_shard(claim);
  ++claim.attempt->progress;
  if (bad != nullptr) {
    fail(claim, v1::ERROR_KIND_TASK_FAILED, "the fibre has no end");
  } else if (character_.fails && to_string(*character_.fails) == stage) {
    fail(claim, v1::ERROR_KIND_TASK_FAILED, "illegal instruction");
  } else if (ground_.happens(ground_.weather.short_resources)) {
    fail(claim, v1::ERROR_KIND_RESOURCE_SHORT, "out of memory");
  } else if (ground_.happens(ground_.weather.passing_failures)) {
    fail(claim, v1::ERROR_KIND_TASK_FAILED,
         fmt::format("a bit flipped at {}", ground_.random.bits()));
  } else {
    const core::Digest work = work_of_claim(claim);
    const std::string bytes = character_.lies
                                  ? fmt::format("lie of {}: {}", character_.name, work.hex())
                                  : simulation::bake(work);
    put_into_spool(claim, bytes);
    upload(claim, bytes, 0);
  }
  thread_is_free();
}

void Machine::upload(const worker::ShardClaim& claim, const std::string& bytes,
                     std::uint64_t tries) {
  const core::Digest digest = core::digest_of(bytes);
  const auto is_settled = std::make_shared<bool>(false);
  const auto again = [this, claim, bytes, tries, is_settled] {
    if (!std::exchange(*is_settled, true)) {
      later(std::min<std::uint64_t>(5'000, 100 << std::min<std::uint64_t>(tries, 6)),
            [this, claim, bytes, tries] { upload(claim, bytes, tries + 1); });
    }
  };
  const auto write = [this, life = life_, claim, digest, bytes, is_settled] {
    const bool is_stored = coordinator_.write_blob(digest, bytes);
    ground_.carry([this, life, claim, digest, bytes, is_settled, is_stored] {
      run_alive(life, [this, claim, digest, bytes, is_settled, is_stored] {
        if (is_cut_off() || std::exchange(*is_settled, true)) {
          return;
        }
        v1::ShardResult result;
        result.set_shard(claim.shard);
        result.set_digest(digest.binary());
        result.set_size_bytes(bytes.size());
        if (is_stored) {
          uploaded(claim, result);
        } else {
          not_uploaded(claim);
        }
      });
    });
  };
  call_coordinator(write, again);
  later(kCallTimeoutMs, again);
}

void Machine::fail(const worker::ShardClaim& claim, v1::ErrorKind kind,
                   const std::string& message) {
  ground_.say("{} fails {} shard {}: {}", worker_id(), worker::log_name(*claim.attempt),
              claim.shard, message);
  v1::TaskError error;
  error.set_kind(kind);
  error.set_shard(claim.shard);
  error.set_message(message);
  if (process_->table.failed(claim, std::move(error))) {
    attempt_is_over();
  }
}

void Machine::give_up(const worker::ShardClaim& claim) {
  if (process_->table.given_up(claim)) {
    attempt_is_over();
  }
  thread_is_free();
}

void Machine::thread_is_free() {
  --process_->busy;
  work();
}

// Reports what there is to report, and forgets what is over.
void Machine::attempt_is_over() {
  for (const v1::AttemptName& name : process_->table.take_forgotten()) {
    spool_.erase({name.job_id(), name.attempt()});
  }
  v1::SynchronizeRequest request;
  process_->table.fill(request);
  bool has_news = false;
  for (const v1::Completion& completion : request.completions()) {
    has_news =
        process_->told.insert({completion.job_id(), completion.attempt()}).second || has_news;
  }
  if (has_news || process_->is_leaving) {
    tell_news();
  }
}

// ---- the spool, as worker::Spool and LeaseLoop::take_over_orphans

void Machine::put_into_spool(const worker::ShardClaim& claim, const std::string& bytes) {
  if (ground_.happens(ground_.weather.forgetful_workers)) {
    return;  // it is not on the disk when the machine dies
  }
  const v1::Assignment& assignment = claim.attempt->assignment;
  Spooled& spooled = spool_[{assignment.name().job_id(), assignment.name().attempt()}];
  spooled.completion.set_job_id(assignment.name().job_id());
  spooled.completion.set_attempt(assignment.name().attempt());
  spooled.completion.set_lease_token(assignment.lease_token());
  spooled.waiting[claim.shard] = bytes;
}

void Machine::uploaded(const worker::ShardClaim& claim, const v1::ShardResult& result) {
  const v1::AttemptName& name = claim.attempt->assignment.name();
  const auto spooled = spool_.find({name.job_id(), name.attempt()});
  if (spooled != spool_.end() && spooled->second.waiting.erase(claim.shard) > 0) {
    *spooled->second.completion.add_results() = result;
  }
  if (process_->table.delivered(claim, result)) {
    attempt_is_over();
  }
}

void Machine::not_uploaded(const worker::ShardClaim& claim) {
  const v1::AttemptName& name = claim.attempt->assignment.name();
  const auto spooled = spool_.find({name.job_id(), name.attempt()});
  if (spooled != spool_.end()) {
    spooled->second.waiting.erase(claim.shard);
  }
  fail(claim, v1::ERROR_KIND_RESOURCE_SHORT, "the coordinator's disk is full");
}

void Machine::take_over_spool() {
  std::erase_if(spool_, [](const auto& entry) {
    return entry.second.waiting.empty() && entry.second.completion.results().empty();
  });
  for (const auto& [name, spooled] : spool_) {
    const auto attempt = process_->table.take_over(spooled.completion, spooled.waiting.size());
    for (const auto& [shard, bytes] : spooled.waiting) {
      later(ground_.between(0, 1'000), [this, claim = worker::ShardClaim{attempt, shard},
                                        bytes = bytes] { upload(claim, bytes, 0); });
    }
  }
}

}  // namespace weft::simulation
