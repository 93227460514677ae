#include "bench/simulated_worker.h"

#include <utility>

#include "fabric/build.h"
#include "fabric/tile.h"
#include "proto/arrays.h"
#include "proto/status.h"

namespace weft::bench {

std::string NoOpResults::of(const v1::TaskSpec& spec) const {
  if (spec.has_geometry()) {
    return fabric::encode_tile(fabric::build_tile(spec.geometry().description()));
  }
  v1::Arrays arrays;
  if (spec.has_grid()) {
    const std::vector<std::uint32_t> coordinates(std::size_t{3} * cells);
    v1::add_array<std::uint32_t>(arrays, "cell_coordinates", {cells, 3}, coordinates);
  } else {
    v1::add_text(arrays, "work", "none");
  }
  return v1::serialize(arrays);
}

SimulatedWorker::SimulatedWorker(std::shared_ptr<grpc::Channel> channel, const std::string& id,
                                 const NoOpResults& results)
    : stub_(v1::WorkerService::NewStub(channel)),
      blobs_(v1::BlobService::NewStub(channel)),
      results_(results) {
  request_.set_worker_id(id);
  request_.set_name(id);
  request_.set_threads(1);
  request_.set_memory_bytes(std::uint64_t{1} << 40);
  request_.set_fingerprint(core::digest_of("a machine").binary());
  request_.set_free_attempts(1);
  request_.set_wait_ms(1000);
}

void SimulatedWorker::count() {
  request_.set_sequence(request_.sequence() + 1);
  request_.set_request_id(request_.worker_id() + "-" + std::to_string(request_.sequence()));
}

v1::SynchronizeResponse SimulatedWorker::exchange() {
  count();
  grpc::ClientContext context;
  v1::SynchronizeResponse response;
  v1::throw_unless_ok(stub_->Synchronize(&context, request_, &response), "synchronize");
  for (const v1::Completion& completion : request_.completions()) {
    acknowledged_shards += static_cast<std::uint64_t>(completion.results_size());
  }
  request_.clear_completions();
  for (const v1::Assignment& assignment : response.assignments()) {
    complete(assignment);
  }
  return response;
}

void SimulatedWorker::hold(const v1::SynchronizeResponse& response) {
  request_.clear_completions();
  for (const v1::Assignment& assignment : response.assignments()) {
    v1::RunningAttempt& running = *request_.add_running();
    running.set_job_id(assignment.name().job_id());
    running.set_attempt(assignment.name().attempt());
    running.set_lease_token(assignment.lease_token());
  }
}

void SimulatedWorker::complete(const v1::Assignment& assignment) {
  const std::string spec = assignment.stage();
  if (spec != stored_spec_) {
    const std::string bytes = results_.of(assignment.spec());
    stored_ = core::digest_of(bytes);
    stored_bytes_ = bytes.size();
    store(bytes, stored_);
    stored_spec_ = spec;
  }
  v1::Completion& completion = *request_.add_completions();
  *completion.mutable_job_id() = assignment.name().job_id();
  completion.set_attempt(assignment.name().attempt());
  completion.set_lease_token(assignment.lease_token());
  completion.set_work_ms(work_ms * assignment.shards());
  for (std::uint64_t i = 0; i < assignment.shards(); ++i) {
    v1::ShardResult& result = *completion.add_results();
    result.set_shard(assignment.first_shard() + i);
    result.set_digest(stored_.binary());
    result.set_size_bytes(stored_bytes_);
  }
}

void SimulatedWorker::store(const std::string& bytes, const core::Digest& digest) {
  constexpr std::size_t kChunkBytes = std::size_t{1} << 20;
  grpc::ClientContext context;
  v1::WriteResponse response;
  const auto writer = blobs_->Write(&context, &response);
  v1::WriteRequest request;
  request.set_digest(digest.binary());
  request.set_size_bytes(bytes.size());
  for (std::size_t at = 0; at == 0 || at < bytes.size(); at += kChunkBytes) {
    request.set_data(bytes.substr(at, kChunkBytes));
    if (!writer->Write(request)) {
      break;
    }
    request.Clear();
  }
  writer->WritesDone();
  v1::throw_unless_ok(writer->Finish(), "store a result");
}

}  // namespace weft::bench
