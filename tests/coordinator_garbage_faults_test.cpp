#include <chrono>
#include <filesystem>
#include <set>
#include <thread>

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include "coordinator/journal/sqlite.h"
#include "coordinator/scheduler/garbage.h"
#include "core/error.h"
#include "tests/coordinator_service_fixture.h"
#include "tests/direct_worker.h"
#include "tests/faulty_disk.h"

namespace weft::coordinator {
namespace {

using Fault = FaultyDisk::Fault;
constexpr auto kOld = std::chrono::hours(24 * 40);

v1::FabricDescription description_of(const std::string& name, std::uint64_t seed) {
  v1::FabricDescription description = small_description(name);
  description.set_seed(static_cast<std::uint32_t>(seed));
  return description;
}

// A coordinator that has something of all that a collection meets: a version with a tag, one whose
// file was not cut yet, a job that runs, results and pieces that nobody needs, and both in the
// trash with what is needed after all.
class GarbageFaults : public testing::Test {
 protected:
  void SetUp() override {
    spdlog::set_level(spdlog::level::off);
    folder_ = make_fault_folder("gc");
    ASSERT_FALSE(folder_.empty());
    state_ = folder_ / "base";
    make_base();
    begin("reference");
    collect();
    operations_ = disk_.count();
    ASSERT_GT(operations_, 30U);
    collect();
    kept_ = files();
    scheduler_.reset();
    RecordProperty("operations", static_cast<int>(operations_));
  }
  void TearDown() override {
    scheduler_.reset();
    std::filesystem::remove_all(folder_);
    spdlog::set_level(spdlog::level::info);
  }

  void make_base() {
    open();
    DirectWorker worker;
    finish(submit(description_of("tiny", 1), "tiny"), worker);
    tiny_ = file_of("tiny");
    CatalogueOrder order;
    order.request_id = "tag";
    (void)scheduler_->catalogue().tag("tiny@1", "approved", order);
    finish(submit(description_of("whole", 2), "whole"), worker);
    whole_ = file_of("whole");
    const VersionRecord whole = scheduler_->catalogue().find("whole");

    const v1::Job cancelled = submit(description_of("dropped", 3), "dropped");
    compute(worker, 8);
    (void)scheduler_->cancel({"cancel", cancelled.id(), {"", {v1::ROLE_ADMIN}}});
    for (int turn = 0; turn < 10; ++turn) {
      worker.turn(*scheduler_);  // until all of it is acknowledged
    }
    worker.acknowledged.clear();
    running_ = submit(description_of("running", 4), "running").id();
    compute(worker, 8);
    worker_ = worker;
    // What was uploaded and is not reported is young, or the worker uploads it again: not here.
    worker_.lose_unacknowledged();
    wait_until_planned();

    put_into_trash();
    scheduler_.reset();
    // As an older weft left it: whole, and its pieces not known.
    Connection(state_ / "journal.db")
        .run("PRAGMA locking_mode = EXCLUSIVE; DELETE FROM manifests WHERE fabric = 'whole'");
    core::write_file_atomically(state_ / "versions" / whole.file, whole_);
    disk_.forget();
  }
  // Something that is needed and something that is not, of results and of pieces.
  void put_into_trash() {
    const std::int64_t later_ms = core::system_clock().now().time_since_epoch().count() + 60'000;
    storage::BlobStore& results = scheduler_->blobs();
    ASSERT_TRUE(results.trash(results.put("a result that nobody knows"), later_ms));
    (void)results.put("another one");
    needed_results_ = scheduler_->results_in_use();
    ASSERT_FALSE(needed_results_.empty());
    ASSERT_TRUE(results.trash(*needed_results_.begin(), later_ms));
    storage::BlobStore pieces(state_ / "pieces");
    ASSERT_TRUE(pieces.trash(pieces.put("a piece of no version"), later_ms));
    (void)pieces.put("another one of none");
    const VersionRecord tiny = scheduler_->catalogue().find("tiny");
    ASSERT_TRUE(pieces.trash(scheduler_->catalogue().pieces_of(tiny).front().digest, later_ms));
  }

  void open() {
    SchedulerOptions options;
    options.state_folder = state_;
    options.commit = fake_commit;
    options.queue.short_ms = 1;
    options.put_off = std::chrono::milliseconds(1);
    scheduler_ = std::make_unique<Scheduler>(std::move(options), core::system_clock());
    wait_until_planned();
  }
  // Jobs are planned by threads of their own, anew after each start.
  void wait_until_planned() {
    for (int tries = 0; tries < 2'000; ++tries) {
      try {
        (void)scheduler_->results_in_use();
        return;
      } catch (const core::Error&) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
    }
    FAIL() << "a job is not planned";
  }
  // A running coordinator on a copy of the base, whose files nobody used for forty days.
  void begin(const std::string& name) {
    scheduler_.reset();
    if (state_ != folder_ / "base") {
      std::filesystem::remove_all(state_);
    }
    state_ = folder_ / name;
    std::filesystem::copy(folder_ / "base", state_, std::filesystem::copy_options::recursive);
    disk_.disarm();
    open();
    age();
    disk_.forget();
    disk_.disarm();
  }
  void age() {
    for (const char* folder : {"blobs", "pieces"}) {
      for (const auto& item : std::filesystem::recursive_directory_iterator(state_ / folder)) {
        if (item.is_regular_file()) {
          std::filesystem::last_write_time(item.path(),
                                           std::filesystem::file_time_type::clock::now() - kOld);
        }
      }
    }
  }
  GarbageReport collect() {
    GarbageOrder order;
    order.empties_trash = true;
    order.now_ms = core::system_clock().now().time_since_epoch().count();
    order.grace_ms = 60'000;
    order.keep_unpublished_ms = std::int64_t{30} * 24 * 3600 * 1000;
    return collect_garbage(*scheduler_, order);
  }

  v1::Job submit(const v1::FabricDescription& description, const std::string& request_id) {
    v1::SubmitRequest request;
    request.set_request_id(request_id);
    *request.mutable_description() = description;
    return scheduler_->submit(request, {"", {v1::ROLE_ADMIN}});
  }
  void compute(DirectWorker& worker, std::size_t shards) {
    const std::size_t wanted = worker.acknowledged.size() + shards;
    for (int turn = 0; turn < 200 && worker.acknowledged.size() < wanted; ++turn) {
      worker.turn(*scheduler_);
    }
    ASSERT_GE(worker.acknowledged.size(), wanted);
  }
  void finish(const v1::Job& job, DirectWorker& worker) {
    v1::Job now = job;
    for (int turn = 0; turn < 400 && now.ended_at_ms() == 0; ++turn) {
      worker.turn(*scheduler_);
      now = scheduler_->job(job.id());
    }
    ASSERT_EQ(now.state(), v1::JOB_STATE_SUCCEEDED) << now.error();
    worker.acknowledged.clear();
  }
  std::string file_of(const std::string& reference) {
    Catalogue& catalogue = scheduler_->catalogue();
    std::string file;
    catalogue.read(catalogue.find(reference), 0, [&](std::string_view bytes) {
      file += bytes;
      return true;
    });
    return file;
  }
  // Whatever lies in the two stores, their trash and the folder of whole files.
  std::set<std::string> files() const {
    std::set<std::string> found;
    for (const char* folder : {"blobs", "pieces", "versions"}) {
      for (const auto& item : std::filesystem::recursive_directory_iterator(state_ / folder)) {
        if (item.is_regular_file()) {
          found.insert(item.path().lexically_relative(state_).string());
        }
      }
    }
    return found;
  }

  void expect_all_that_is_needed(const std::string& where) {
    const std::set<core::Digest> in_use = scheduler_->results_in_use();
    for (const core::Digest& digest : needed_results_) {
      EXPECT_TRUE(in_use.contains(digest)) << where << ", result " << digest.hex();
      EXPECT_TRUE(scheduler_->blobs().get(digest)) << where << ", result " << digest.hex();
    }
    EXPECT_EQ(file_of("tiny:approved"), tiny_) << where;
    EXPECT_EQ(file_of("whole"), whole_) << where;
  }

  // A collection that is killed at its nth operation, or loses its power there.
  void play(std::uint64_t nth, bool loses_power) {
    const std::string where = "operation " + std::to_string(nth);
    begin("run");
    disk_.arm(nth, Fault::kPowerLoss);
    try {
      (void)collect();
    } catch (const core::Error&) {
    }
    ASSERT_TRUE(disk_.has_struck()) << where;
    scheduler_.reset();
    if (loses_power) {
      disk_.reboot(nth);
    }
    disk_.forget();
    disk_.disarm();
    open();
    expect_all_that_is_needed(where);
    age();
    (void)collect();
    (void)collect();
    expect_all_that_is_needed(where);
    EXPECT_EQ(without_trash(files()), without_trash(kept_)) << where;
    DirectWorker worker = worker_;
    finish(scheduler_->job(running_), worker);
    EXPECT_TRUE(worker.given_twice.empty()) << where << ": " << worker.given_twice.front();
  }
  // When a thing was thrown away decides when it is gone for good.
  static std::set<std::string> without_trash(std::set<std::string> files) {
    std::erase_if(files, [](const std::string& file) { return file.find("/trash/") != file.npos; });
    return files;
  }

  std::filesystem::path folder_;
  std::filesystem::path state_;
  FaultyDisk disk_;
  std::unique_ptr<Scheduler> scheduler_;
  std::string tiny_;
  std::string whole_;
  std::string running_;
  DirectWorker worker_;
  std::set<core::Digest> needed_results_;
  std::set<std::string> kept_;
  std::uint64_t operations_ = 0;
};

TEST_F(GarbageFaults, KilledAtAnyOperation_TakesNothingThatIsNeeded) {
  for (std::uint64_t nth = 1; nth <= operations_ && !HasFatalFailure(); ++nth) {
    play(nth, false);
  }
}

TEST_F(GarbageFaults, PowerLossAtAnyOperation_TakesNothingThatIsNeeded) {
  for (std::uint64_t nth = 1; nth <= operations_ && !HasFatalFailure(); ++nth) {
    play(nth, true);
  }
}

}  // namespace
}  // namespace weft::coordinator
