#include <algorithm>
#include <utility>

#include "coordinator/scheduler/messages.h"
#include "core/check.h"
#include "tests/simulation/coordinator_model.h"

// The calls of workers.

namespace weft::simulation {

using namespace coordinator;

namespace {

void put(const AttemptName& name, v1::AttemptName* message) {
  message->set_job_id(name.job);
  message->set_attempt(name.attempt);
}

}  // namespace

void CoordinatorModel::synchronize(const v1::SynchronizeRequest& request, Answer answer) {
  ReportEvent report = report_from(request);
  for (CompletionClaim& claim : report.completions) {
    std::erase_if(claim.results,
                  [&](const ShardResult& result) { return !blobs_.has(result.digest); });
  }
  process_->closed_ms.erase(report.worker);
  std::uint64_t& newest = process_->sequences[report.worker];
  if (request.sequence() <= newest) {
    answer(nullptr);
    return;
  }
  newest = request.sequence();
  const auto older = process_->held.find(report.worker);
  if (older != process_->held.end()) {
    older->second.answer(nullptr);
    process_->held.erase(older);
  }
  const std::string worker = report.worker;
  process_->held[worker] = {std::move(report), request.sequence(),
                            ground_.timeline.now_ms() + request.wait_ms(), 0, std::move(answer)};
  look(worker, request.sequence(), 0);
}

// As the loop in Scheduler::synchronize.
void CoordinatorModel::look(const std::string& worker, std::uint64_t sequence,
                            std::uint64_t look_count) {
  const auto found = process_->held.find(worker);
  if (found == process_->held.end() || found->second.sequence != sequence ||
      found->second.looks != look_count) {
    return;
  }
  HeldCall& call = found->second;
  ++call.looks;
  Reply reply;
  const std::uint64_t ticket = apply(call.report, &reply);
  const bool has_news =
      !reply.assignments.empty() || !reply.stop.empty() || !reply.acknowledged.empty();
  const std::uint64_t now_ms = ground_.timeline.now_ms();
  if (!has_news && !call.report.leaving && now_ms < call.deadline_ms) {
    later(std::min<std::uint64_t>(1000, call.deadline_ms - now_ms),
          [this, worker, sequence, looks = call.looks] { look(worker, sequence, looks); });
    return;
  }
  HeldCall answered = std::move(call);
  process_->held.erase(found);
  v1::SynchronizeResponse response = message(reply);
  const std::vector<core::Digest> works =
      checks_.acknowledged(answered.report, reply, process_->queue);
  when_durable(ticket, [this, answered = std::move(answered), response = std::move(response), works,
                        reply = std::move(reply)] {
    checks_.answered(works, reply, journal_.durable());
    answered.answer(&response);
  });
}

// Something changed that workers which wait may get.
void CoordinatorModel::look_at_all() {
  process_->will_look = false;
  std::vector<std::string> workers;
  for (const auto& [worker, call] : process_->held) {
    workers.push_back(worker);
  }
  for (const std::string& worker : workers) {
    const auto found = process_->held.find(worker);
    if (found != process_->held.end()) {
      look(worker, found->second.sequence, found->second.looks);
    }
  }
}

void CoordinatorModel::hang_up(const std::string& worker, std::uint64_t sequence) {
  const auto found = process_->held.find(worker);
  if (found != process_->held.end() && found->second.sequence == sequence) {
    process_->held.erase(found);
  }
}

void CoordinatorModel::connection_closed(const std::string& worker) {
  const std::uint64_t closed_ms = ground_.timeline.now_ms();
  process_->held.erase(worker);
  process_->closed_ms[worker] = closed_ms;
  later(settings_.disconnect_ms, [this, worker, closed_ms] {
    const auto found = process_->closed_ms.find(worker);
    if (found != process_->closed_ms.end() && found->second == closed_ms) {
      process_->closed_ms.erase(found);
      ground_.say("{} is gone", worker);
      apply(DisconnectEvent{worker}, nullptr);
    }
  });
}

v1::SynchronizeResponse CoordinatorModel::message(const Reply& reply) const {
  v1::SynchronizeResponse response;
  for (const AssignAction& assign : reply.assignments) {
    const JobFile& file = process_->files.at(assign.job);
    const FakeStage& stage = file.stages.at(assign.stage);
    v1::Assignment& message = *response.add_assignments();
    put({assign.job, assign.attempt}, message.mutable_name());
    message.set_lease_token(assign.token);
    message.set_lease_ms(assign.lease_ms);
    message.set_fabric(file.fabric.name);
    message.set_stage(to_string(assign.stage));
    message.mutable_spec()->mutable_geometry()->mutable_description()->set_name(stage.spec);
    message.set_shard_count(stage.shard_count);
    for (const core::Digest& input : stage.inputs) {
      message.add_inputs(input.binary());
    }
    message.set_first_shard(assign.first_shard);
    message.set_shards(assign.shards);
    for (std::uint64_t i = 0; i < assign.shards && !stage.shard_inputs.empty(); ++i) {
      message.add_shard_inputs(stage.shard_inputs[assign.first_shard + i].binary());
    }
  }
  for (const AttemptName& name : reply.leases) {
    v1::Lease& lease = *response.add_leases();
    put(name, lease.mutable_name());
    lease.set_lease_ms(settings_.lease_ms);
  }
  for (const AttemptName& name : reply.stop) {
    put(name, response.add_stop());
  }
  for (const AttemptName& name : reply.acknowledged) {
    put(name, response.add_acknowledged());
  }
  return response;
}

bool CoordinatorModel::write_blob(const core::Digest& digest, const std::string& bytes) {
  if (blobs_.has(digest)) {
    return true;
  }
  if (ground_.happens(ground_.weather.blob_failures)) {
    return false;
  }
  blobs_.put(digest, bytes);
  return true;
}

std::optional<std::string> CoordinatorModel::read_blob(const core::Digest& digest) {
  std::optional<std::string> bytes = blobs_.get(digest);
  if (!bytes) {
    result_lost(digest);
  }
  return bytes;
}

}  // namespace weft::simulation
