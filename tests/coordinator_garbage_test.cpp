#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>

#include "coordinator/scheduler/garbage.h"
#include "tests/coordinator_service_fixture.h"

// What is collected and what is not, and versions that lose their pieces, with jobs that run.

namespace weft::coordinator {
namespace {

constexpr int kTurns = 300;
constexpr auto kOld = std::chrono::hours(24 * 40);

class Garbage : public ServiceTest {
 protected:
  v1::Job run(const v1::FabricDescription& description, const std::string& request_id,
              FakeWorker& worker) {
    v1::Job submitted;
    EXPECT_TRUE(submit(request_id, description, &submitted).ok());
    worker.request().set_wait_ms(50);
    for (int turn = 0; turn < kTurns; ++turn) {
      worker.work();
      const v1::Job now = job(submitted.id());
      if (now.ended_at_ms() != 0) {
        return now;
      }
    }
    ADD_FAILURE() << "the job does not end";
    return {};
  }
  // Leaves a job with some results and no version.
  v1::Job begin(const v1::FabricDescription& description, const std::string& request_id,
                FakeWorker& worker, std::uint64_t shards) {
    v1::Job submitted;
    EXPECT_TRUE(submit(request_id, description, &submitted).ok());
    worker.request().set_wait_ms(50);
    for (int turn = 0; turn < kTurns && worker.shards < shards; ++turn) {
      worker.work();
    }
    worker.work();  // reports the last ones
    return submitted;
  }
  void cancel(const v1::Job& wanted) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_request_id("cancel-" + wanted.id());
    request.set_job_id(wanted.id());
    v1::CancelJobResponse response;
    EXPECT_TRUE(jobs_->CancelJob(&context, request, &response).ok());
  }
  static std::uint64_t count(const v1::Job& of,
                             google::protobuf::uint64 (v1::StageProgress::*number)() const) {
    std::uint64_t sum = 0;
    for (const v1::StageProgress& stage : of.stages()) {
      sum += (stage.*number)();
    }
    return sum;
  }
  // Makes everything that is kept look as if nobody had used it for forty days.
  void age() {
    for (const char* folder : {"blobs", "pieces"}) {
      for (const auto& item :
           std::filesystem::recursive_directory_iterator(folder_ / "state" / folder)) {
        if (item.is_regular_file()) {
          std::filesystem::last_write_time(item.path(),
                                           std::filesystem::file_time_type::clock::now() - kOld);
        }
      }
    }
  }
  GarbageReport collect(bool is_dry_run = false, bool empties_trash = false) {
    GarbageOrder order;
    order.is_dry_run = is_dry_run;
    order.empties_trash = empties_trash;
    order.now_ms = core::system_clock().now().time_since_epoch().count();
    order.grace_ms = 60'000;
    order.keep_unpublished_ms = std::int64_t{30} * 24 * 3600 * 1000;
    return collect_garbage(*scheduler_, order);
  }
  std::string file_of(const std::string& reference, grpc::Status* status = nullptr) {
    grpc::ClientContext context;
    v1::FetchVersionRequest request;
    request.set_reference(reference);
    const auto reader = catalogue_->FetchVersion(&context, request);
    std::string data;
    v1::FetchVersionResponse response;
    while (reader->Read(&response)) {
      data += response.data();
    }
    const grpc::Status ended = reader->Finish();
    if (status != nullptr) {
      *status = ended;
    } else {
      EXPECT_TRUE(ended.ok()) << ended.error_message();
    }
    return data;
  }
};

TEST_F(Garbage, VersionsAndWhatTheyWereMadeFromStay) {
  FakeWorker worker(channel_, "w");
  run(small_description(), "r1", worker);
  age();
  const GarbageReport report = collect(false, true);
  EXPECT_EQ(report.removed, 0U);
  EXPECT_GT(report.kept, 10U);
  EXPECT_NE(file_of("tiny"), "");
  const std::uint64_t shards = worker.shards;
  EXPECT_EQ(run(small_description(), "r2", worker).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(worker.shards, shards);
}

TEST_F(Garbage, ResultsThatNobodyNeedsGoToTheTrashAndComeBackWhenAJobUsesThem) {
  FakeWorker worker(channel_, "w");
  cancel(begin(small_description(), "r1", worker, 9));
  EXPECT_EQ(collect().removed, 0U) << "they are young";
  age();
  const GarbageReport planned = collect(true);
  EXPECT_GE(planned.removed, 9U);
  EXPECT_FALSE(planned.examples.empty());
  const GarbageReport first = collect();
  EXPECT_EQ(first.removed, planned.removed) << "a dry run removes nothing";
  EXPECT_EQ(first.removed_bytes, planned.removed_bytes);
  EXPECT_EQ(collect(false, true).emptied, 0U) << "they lie there for a moment only";

  const std::uint64_t before = worker.shards;
  const v1::Job ended = run(small_description(), "r2", worker);
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  std::uint64_t all = 0;
  std::uint64_t cached = 0;
  for (const v1::StageProgress& stage : ended.stages()) {
    all += stage.shards();
    cached += stage.shards_cached();
  }
  EXPECT_GE(cached, 9U);
  EXPECT_EQ(worker.shards - before, all - cached);
  EXPECT_GT(ended.cached_bytes(), 0U);
  EXPECT_EQ(ended.version().cached_shards(), cached);
  EXPECT_EQ(ended.version().computed_shards(), all - cached);
}

TEST_F(Garbage, WhatIsEmptiedFromTheTrashIsComputedAgain) {
  FakeWorker worker(channel_, "w");
  cancel(begin(small_description(), "r1", worker, 9));
  age();
  const std::uint64_t removed = collect().removed;
  age();
  EXPECT_EQ(collect(true, true).emptied, removed);
  EXPECT_EQ(collect(false, true).emptied, removed);
  EXPECT_EQ(collect(false, true).emptied, 0U);
  const v1::Job ended = run(small_description(), "r2", worker);
  EXPECT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  EXPECT_EQ(ended.cached_bytes(), 0U);
}

TEST_F(Garbage, ResultsOfAnUnfinishedJobStayAlsoAfterARestart) {
  FakeWorker worker(channel_, "w");
  const v1::Job submitted = begin(small_description(), "r1", worker, 9);
  const v1::SynchronizeRequest kept = worker.request();
  age();
  collect();  // what is uploaded and not reported yet looks old, too, and comes back
  stop();
  start();
  FakeWorker again(channel_, "w");
  again.request() = kept;
  for (int turn = 0; turn < kTurns && job(submitted.id()).ended_at_ms() == 0; ++turn) {
    age();
    collect();
    again.work();
  }
  const v1::Job ended = job(submitted.id());
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  EXPECT_EQ(worker.shards + again.shards, count(ended, &v1::StageProgress::shards));
}

// A job takes old results that nobody needed while they are being collected, again and again.
TEST_F(Garbage, CollectedWhileJobsRun_NothingTheyUseIsLost) {
  FakeWorker worker(channel_, "w");
  const v1::Job first = begin(small_description(), "r1", worker, 12);
  cancel(first);
  const std::uint64_t recorded = count(job(first.id()), &v1::StageProgress::shards_done);
  const std::uint64_t before = worker.shards;
  age();
  std::atomic<bool> is_over{false};
  std::thread collector([&] {
    while (!is_over) {
      collect(false, true);
    }
  });
  const v1::Job ended = run(small_description(), "r2", worker);
  is_over = true;
  collector.join();
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  EXPECT_EQ(count(ended, &v1::StageProgress::failures), 0U);
  EXPECT_EQ(count(ended, &v1::StageProgress::shards_cached), recorded);
  EXPECT_EQ(worker.shards - before, count(ended, &v1::StageProgress::shards) - recorded);
  const std::string once = file_of("tiny");
  stop();
  std::filesystem::remove_all(folder_ / "state");
  start();
  FakeWorker fresh(channel_, "f");
  run(small_description(), "r3", fresh);
  EXPECT_EQ(file_of("tiny"), once);
}

TEST_F(Garbage, PiecesOfNoVersionGo) {
  FakeWorker worker(channel_, "w");
  run(small_description(), "r1", worker);
  // As a process that died between the pieces and the version leaves them.
  storage::BlobStore pieces(folder_ / "state" / "pieces");
  const core::Digest orphan = pieces.put("a piece of a version that never was");
  EXPECT_EQ(collect().removed, 0U);
  age();
  EXPECT_EQ(collect().removed, 1U);
  EXPECT_FALSE(pieces.has(orphan));
  EXPECT_NE(file_of("tiny"), "");
}

TEST_F(Garbage, LostPieces_AreMadeAgainFromResultsOrBySubmittingAgain) {
  FakeWorker worker(channel_, "w");
  run(small_description(), "r1", worker);
  const std::string file = file_of("tiny");
  std::filesystem::remove_all(folder_ / "state" / "pieces");
  std::filesystem::create_directories(folder_ / "state" / "pieces");
  EXPECT_EQ(file_of("tiny"), file) << "its results are there";

  for (const char* folder : {"pieces", "blobs"}) {
    std::filesystem::remove_all(folder_ / "state" / folder);
    std::filesystem::create_directories(folder_ / "state" / folder);
  }
  grpc::Status status;
  file_of("tiny@1", &status);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_NE(status.error_message().find("tiny@1"), std::string::npos) << status.error_message();
  EXPECT_EQ(run(small_description(), "r2", worker).version().number(), 1U);
  EXPECT_EQ(file_of("tiny@1"), file);
}

// Of transfer, a shard is 16,384 paths of one cell: two full ones of 40,000 are in 100,000 too.
TEST_F(Garbage, RaisedSampleCount_AddsShardsOnly) {
  FakeWorker worker(channel_, "w");
  run(small_description(), "r1", worker);
  const std::uint64_t before = worker.shards;
  v1::FabricDescription finer = small_description();
  finer.mutable_precompute()->set_paths_per_cell(100'000);
  const v1::Job ended = run(finer, "r2", worker);
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  for (const v1::StageProgress& stage : ended.stages()) {
    const std::uint64_t computed = stage.shards() - stage.shards_cached();
    EXPECT_EQ(computed, stage.name() == "transfer" ? kSmallCells * 5U : 0U) << stage.name();
  }
  EXPECT_EQ(worker.shards - before, kSmallCells * 5U);
  EXPECT_EQ(ended.version().computed_shards(), kSmallCells * 5U);
}

}  // namespace
}  // namespace weft::coordinator
