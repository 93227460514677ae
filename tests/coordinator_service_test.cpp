#include <algorithm>
#include <thread>

#include "core/error.h"
#include "tests/coordinator_service_fixture.h"

namespace weft::coordinator {
namespace {

constexpr int kTurns = 200;

class Service : public ServiceTest {
 protected:
  // Lets the workers take turns until the job has ended.
  v1::Job run(const std::string& id, const std::vector<FakeWorker*>& workers) {
    for (int turn = 0; turn < kTurns; ++turn) {
      for (FakeWorker* worker : workers) {
        worker->request().set_wait_ms(50);
        worker->work();
      }
      const v1::Job now = job(id);
      if (now.ended_at_ms() != 0) {
        return now;
      }
    }
    ADD_FAILURE() << "the job does not end: " << job(id).ShortDebugString();
    return {};
  }
  std::string fetch(const std::string& reference, std::uint64_t offset, v1::Version* version) {
    grpc::ClientContext context;
    v1::FetchVersionRequest request;
    request.set_reference(reference);
    request.set_offset(offset);
    const auto reader = catalogue_->FetchVersion(&context, request);
    std::string data;
    v1::FetchVersionResponse response;
    while (reader->Read(&response)) {
      if (response.has_version()) {
        *version = response.version();
      }
      data += response.data();
    }
    EXPECT_TRUE(reader->Finish().ok());
    return data;
  }
};

TEST_F(Service, SubmittedJob_EndsAsAVersionThatCanBeFetched) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  EXPECT_EQ(submitted.state(), v1::JOB_STATE_QUEUED);
  EXPECT_NE(submitted.waiting_for(), "");
  FakeWorker worker(channel_, "w");
  const v1::Job ended = run(submitted.id(), {&worker});
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  EXPECT_EQ(ended.version().fabric(), "tiny");
  EXPECT_EQ(ended.version().number(), 1U);
  for (const v1::StageProgress& stage : ended.stages()) {
    EXPECT_EQ(stage.state(), v1::STAGE_STATE_DONE) << stage.name();
    EXPECT_EQ(stage.shards_done(), stage.shards()) << stage.name();
  }

  v1::Version version;
  const std::string file = fetch("tiny@latest", 0, &version);
  EXPECT_EQ(core::digest_of(file).binary(), version.content_digest());
  EXPECT_EQ(file.size(), version.size_bytes());
  EXPECT_EQ(fetch("tiny@1", 100, &version), file.substr(100));
  EXPECT_EQ(fetch("tiny@1", file.size(), &version), "");
}

TEST_F(Service, Content_DoesNotDependOnWhoComputesWhat) {
  v1::Job first;
  ASSERT_TRUE(submit("r1", small_description("first"), &first).ok());
  FakeWorker alone(channel_, "alone");
  const std::string once = run(first.id(), {&alone}).version().content_digest();
  alone.request().set_leaving(true);
  alone.work();

  stop();
  std::filesystem::remove_all(folder_ / "state");
  start();
  v1::Job again;
  ASSERT_TRUE(submit("r2", small_description("first"), &again).ok());
  std::vector<std::unique_ptr<FakeWorker>> workers;
  for (const char* id : {"a", "b", "c"}) {
    workers.push_back(std::make_unique<FakeWorker>(channel_, id));
    workers.back()->request().set_threads(1);
  }
  const v1::Job ended = run(again.id(), {workers[2].get(), workers[0].get(), workers[1].get()});
  EXPECT_EQ(ended.version().content_digest(), once);
  for (const auto& worker : workers) {
    EXPECT_GT(worker->shards, 0U);
  }
}

TEST_F(Service, SubmittingTwice_IsOneJob) {
  v1::Job first;
  v1::Job second;
  ASSERT_TRUE(submit("r1", small_description(), &first).ok());
  ASSERT_TRUE(submit("r1", small_description(), &second).ok());
  EXPECT_EQ(first.id(), second.id());
  EXPECT_EQ(submit("r1", small_description("other")).error_code(),
            grpc::StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(submit("", small_description()).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(submit("r 2", small_description()).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  v1::FabricDescription wrong = small_description();
  wrong.mutable_materials(0)->set_beta_r_deg(-1);
  EXPECT_EQ(submit("r2", wrong).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(scheduler_->jobs(false, 10).size(), 1U);
  // And once more after it has ended, and after a restart.
  FakeWorker worker(channel_, "w");
  run(first.id(), {&worker});
  ASSERT_TRUE(submit("r1", small_description(), &second).ok());
  EXPECT_EQ(second.state(), v1::JOB_STATE_SUCCEEDED);
  stop();
  start();
  ASSERT_TRUE(submit("r1", small_description(), &second).ok());
  EXPECT_EQ(second.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(second.id(), first.id());
}

TEST_F(Service, EqualJob_ReusesAllResultsAndTheVersion) {
  v1::Job first;
  v1::Job second;
  ASSERT_TRUE(submit("r1", small_description(), &first).ok());
  FakeWorker worker(channel_, "w");
  run(first.id(), {&worker});
  const std::uint64_t shards = worker.shards;
  ASSERT_TRUE(submit("r2", small_description(), &second).ok());
  const v1::Job ended = run(second.id(), {&worker});
  EXPECT_EQ(worker.shards, shards);
  EXPECT_EQ(ended.version().number(), 1U);
  EXPECT_EQ(ended.version().job_id(), first.id());
  // Another colour redoes what follows paths of light, and no visibility.
  v1::FabricDescription blue = small_description();
  blue.mutable_materials(0)->mutable_c_tt()->set_r(0.1);
  v1::Job third;
  ASSERT_TRUE(submit("r3", blue, &third).ok());
  const v1::Job recoloured = run(third.id(), {&worker});
  EXPECT_EQ(recoloured.version().number(), 2U);
  std::uint64_t of_light = 0;
  for (const v1::StageProgress& stage : recoloured.stages()) {
    of_light += stage.name() == "transfer" || stage.name() == "shadow" ? stage.shards() : 0;
  }
  EXPECT_GE(of_light, kSmallCells * 3U);
  EXPECT_EQ(worker.shards - shards, of_light);
}

TEST_F(Service, RestartedCoordinator_GoesOnWithoutComputingAnythingAgain) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  FakeWorker before(channel_, "before");
  for (int turn = 0; turn < 8; ++turn) {
    before.work();
  }
  // What it completed last is not reported yet: the worker keeps it.
  ASSERT_NE(job(submitted.id()).state(), v1::JOB_STATE_SUCCEEDED);
  const v1::SynchronizeRequest kept = before.request();
  stop();
  start();
  FakeWorker after(channel_, "before");
  after.request() = kept;
  const v1::Job ended = run(submitted.id(), {&after});
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  std::uint64_t all = 0;
  for (const v1::StageProgress& stage : ended.stages()) {
    all += stage.shards();
  }
  EXPECT_EQ(before.shards + after.shards, all);
  std::vector<std::string> twice = before.log;
  twice.insert(twice.end(), after.log.begin(), after.log.end());
  std::sort(twice.begin(), twice.end());
  EXPECT_EQ(std::adjacent_find(twice.begin(), twice.end()), twice.end());
}

TEST_F(Service, LostResult_IsComputedAgain) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  FakeWorker worker(channel_, "w");
  while (worker.log.empty()) {
    worker.work();
  }
  ASSERT_EQ(worker.log[0], "geometry 0+1");
  while (worker.log.size() < 4) {
    worker.work();
  }
  // Somebody wipes the blobs.
  std::filesystem::remove_all(folder_ / "state" / "blobs");
  std::filesystem::create_directories(folder_ / "state" / "blobs");
  worker.request().clear_completions();
  std::string data;
  const core::Digest tile =
      core::digest_of(fake_result(plan(small_description(), {}, {})[0].spec, 0));
  EXPECT_EQ(read(tile, 0, &data).error_code(), grpc::StatusCode::NOT_FOUND);
  worker.log.clear();
  worker.request().set_worker_id("another");
  const v1::Job ended = run(submitted.id(), {&worker});
  EXPECT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  EXPECT_EQ(worker.log[0], "geometry 0+1");
}

TEST_F(Service, TaskThatFailsEverywhere_FailsItsJobWhichSaysWhy) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  std::vector<std::unique_ptr<FakeWorker>> workers;
  for (const char* id : {"a", "b", "c"}) {
    workers.push_back(std::make_unique<FakeWorker>(channel_, id));
    workers.back()->request().set_wait_ms(50);
  }
  v1::Job now = submitted;
  for (int turn = 0; turn < kTurns && now.ended_at_ms() == 0; ++turn) {
    for (const auto& worker : workers) {
      worker->work("the yarns cannot be packed");
    }
    now = job(submitted.id());
  }
  EXPECT_EQ(now.state(), v1::JOB_STATE_FAILED);
  EXPECT_NE(now.error().find("geometry shard 0"), std::string::npos) << now.error();
  EXPECT_NE(now.error().find("the yarns cannot be packed"), std::string::npos) << now.error();
}

TEST_F(Service, WatchedJob_IsToldToItsEnd) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  std::vector<v1::Job> seen;
  std::thread watcher([&] {
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_job_id(submitted.id().substr(0, 6));
    const auto reader = jobs_->WatchJob(&context, request);
    v1::WatchJobResponse response;
    while (reader->Read(&response)) {
      seen.push_back(response.job());
    }
    EXPECT_TRUE(reader->Finish().ok());
  });
  FakeWorker worker(channel_, "w");
  run(submitted.id(), {&worker});
  watcher.join();
  ASSERT_GE(seen.size(), 2U);
  EXPECT_EQ(seen.back().state(), v1::JOB_STATE_SUCCEEDED);
  for (std::size_t i = 1; i < seen.size(); ++i) {
    EXPECT_GT(seen[i].revision(), seen[i - 1].revision());
  }
}

TEST_F(Service, CancelledJob_StaysCancelled) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  FakeWorker worker(channel_, "w");
  while (!worker.work()) {
  }
  grpc::ClientContext context;
  v1::CancelJobRequest request;
  request.set_request_id("c1");
  request.set_job_id(submitted.id());
  v1::CancelJobResponse response;
  ASSERT_TRUE(jobs_->CancelJob(&context, request, &response).ok());
  EXPECT_EQ(response.job().state(), v1::JOB_STATE_CANCELLED);
  EXPECT_FALSE(worker.work());
  EXPECT_EQ(worker.request().completions_size(), 0);  // acknowledged, though nobody wants it
  stop();
  start();
  EXPECT_EQ(job(submitted.id()).state(), v1::JOB_STATE_CANCELLED);
}

TEST_F(Service, UnknownJob_IsNotFound) {
  grpc::ClientContext context;
  v1::GetJobRequest request;
  request.set_job_id("j000000000000");
  v1::GetJobResponse response;
  const grpc::Status status = jobs_->GetJob(&context, request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_NE(status.error_message().find("j000000000000"), std::string::npos);
}

TEST_F(Service, WaitingWorker_IsGivenWorkAsSoonAsThereIsAny) {
  FakeWorker worker(channel_, "w");
  worker.request().set_wait_ms(30'000);
  v1::SynchronizeResponse response;
  std::thread waiting([&] { EXPECT_TRUE(worker.exchange(&response).ok()); });
  while (scheduler_->workers().empty()) {
    std::this_thread::yield();
  }
  ASSERT_TRUE(submit("r1", small_description()).ok());
  waiting.join();
  ASSERT_EQ(response.assignments_size(), 1);
  EXPECT_EQ(response.assignments(0).stage(), "geometry");
}

TEST_F(Service, NewerCallOfAWorker_EndsTheOneThatWaits) {
  FakeWorker worker(channel_, "w");
  FakeWorker newer(channel_, "w");
  worker.request().set_wait_ms(30'000);
  newer.request().set_wait_ms(0);
  newer.request().set_sequence(5);
  grpc::Status status;
  std::thread waiting([&] {
    v1::SynchronizeResponse response;
    status = worker.exchange(&response);
  });
  while (scheduler_->workers().empty()) {
    std::this_thread::yield();
  }
  newer.work();
  waiting.join();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::ABORTED);
}

TEST_F(Service, MalformedReports_AreRefused) {
  const auto code_of = [&](auto&& change) {
    FakeWorker worker(channel_, "w");
    worker.request().set_wait_ms(0);
    change(worker.request());
    v1::SynchronizeResponse response;
    return worker.exchange(&response).error_code();
  };
  const auto invalid = grpc::StatusCode::INVALID_ARGUMENT;
  EXPECT_EQ(code_of([](auto& r) { r.set_worker_id("../w"); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.set_threads(0); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.set_threads(100'000); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.set_fingerprint("short"); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.set_wait_ms(1'000'000); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.set_free_attempts(65); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.set_name(std::string(200, 'x')); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.add_completions()->add_results(); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.add_completions()->mutable_error(); }), invalid);
  EXPECT_EQ(code_of([](auto& r) { r.add_running()->set_lease_token("x"); }), grpc::StatusCode::OK);
  EXPECT_EQ(code_of([](auto& r) {
              r.set_sequence(9);
              r.set_fingerprint(core::digest_of("another machine").binary());
            }),
            grpc::StatusCode::FAILED_PRECONDITION);
}

TEST_F(Service, ResultWithoutItsBlob_IsNotTaken) {
  v1::Job submitted;
  ASSERT_TRUE(submit("r1", small_description(), &submitted).ok());
  FakeWorker worker(channel_, "w");
  while (!worker.work()) {
  }
  worker.request().mutable_completions(0)->mutable_results(0)->set_digest(
      core::digest_of("never written").binary());
  worker.work();
  EXPECT_EQ(job(submitted.id()).stages(0).shards_done(), 0U);
  EXPECT_EQ(run(submitted.id(), {&worker}).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(Service, Blobs_AreWrittenOnceCheckedAndReadFromAnywhere) {
  std::string blob(3'000'000, 'a');
  blob[2'500'000] = 'b';
  const core::Digest digest = core::digest_of(blob);
  v1::WriteResponse response;
  EXPECT_EQ(write(blob, core::digest_of("another"), &response).error_code(),
            grpc::StatusCode::DATA_LOSS);
  ASSERT_TRUE(write(blob, digest, &response).ok());
  // A second name shows whether the file is replaced.
  const std::filesystem::path beside = folder_ / "beside";
  std::filesystem::create_hard_link(scheduler_->blobs().path_of(digest), beside);
  ASSERT_TRUE(write(blob, digest, &response).ok());
  EXPECT_TRUE(std::filesystem::equivalent(scheduler_->blobs().path_of(digest), beside));
  std::string data;
  ASSERT_TRUE(read(digest, 0, &data).ok());
  EXPECT_EQ(data, blob);
  data.clear();
  ASSERT_TRUE(read(digest, 2'400'000, &data).ok());
  EXPECT_EQ(data, blob.substr(2'400'000));
  EXPECT_EQ(read(digest, 3'000'001, &data).error_code(), grpc::StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(read(core::digest_of("another"), 0, &data).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(Service, DamagedBlob_IsNeverServed) {
  const std::string blob = "a result";
  const core::Digest digest = core::digest_of(blob);
  v1::WriteResponse response;
  ASSERT_TRUE(write(blob, digest, &response).ok());
  core::write_file_atomically(scheduler_->blobs().path_of(digest), "a resulT");
  std::string data;
  EXPECT_EQ(read(digest, 0, &data).error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(data, "");
}

TEST_F(Service, AddressesThatOthersReach_AreRefused) {
  for (const char* address : {"0.0.0.0:0", "[::]:0", "192.168.1.1:0", "example.org:0"}) {
    try {
      const Server server(*scheduler_, address);
      ADD_FAILURE() << address << " was taken";
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kPermissionDenied) << address;
    }
  }
}

}  // namespace
}  // namespace weft::coordinator
