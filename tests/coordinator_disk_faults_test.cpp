#include <set>

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include "core/error.h"
#include "tests/coordinator_service_fixture.h"
#include "tests/direct_worker.h"
#include "tests/faulty_disk.h"

namespace weft::coordinator {
namespace {

using Fault = FaultyDisk::Fault;

v1::FabricDescription recoloured() {
  v1::FabricDescription description = small_description();
  description.mutable_materials(0)->mutable_c_tt()->set_r(0.1);
  return description;
}

// One whole life of a job, submitted, computed and published as version 2 of a fabric, on a disk on
// which the nth operation goes wrong.
class DiskFaults : public testing::Test {
 protected:
  void SetUp() override {
    spdlog::set_level(spdlog::level::off);
    folder_ = make_fault_folder("disk");
    ASSERT_FALSE(folder_.empty());
    state_ = folder_ / "base";
    open();
    publish(small_description(), "first");
    scheduler_.reset();
    // What the job gives where nothing goes wrong.
    begin("reference");
    open();
    publish(recoloured(), "second");
    reference_ = scheduler_->catalogue().find("tiny@2").content_digest;
    operations_ = disk_.count();
    scheduler_.reset();
    RecordProperty("operations", static_cast<int>(operations_));
    ASSERT_GT(operations_, 100U);
  }
  void TearDown() override {
    scheduler_.reset();
    std::filesystem::remove_all(folder_);
    spdlog::set_level(spdlog::level::info);
  }

  void begin(const std::string& name) {
    std::filesystem::remove_all(state_ == folder_ / "base" ? folder_ / "none" : state_);
    state_ = folder_ / name;
    std::filesystem::copy(folder_ / "base", state_, std::filesystem::copy_options::recursive);
    disk_.forget();
    disk_.disarm();
  }
  void open() {
    SchedulerOptions options;
    options.state_folder = state_;
    options.commit = fake_commit;
    options.queue.short_ms = 1;
    options.put_off = std::chrono::milliseconds(1);
    scheduler_ = std::make_unique<Scheduler>(std::move(options), core::system_clock());
  }
  // What is left of the process is torn down without touching the disk.
  void crash(std::uint64_t seed) {
    const bool loses_power = disk_.is_without_power();
    disk_.lose_power();
    scheduler_.reset();
    if (loses_power) {
      disk_.reboot(seed);
    }
    disk_.forget();
    disk_.disarm();
  }

  v1::Job submit(const v1::FabricDescription& description, const std::string& request_id) {
    v1::SubmitRequest request;
    request.set_request_id(request_id);
    *request.mutable_description() = description;
    return scheduler_->submit(request, {"", {v1::ROLE_ADMIN}});
  }
  v1::Job publish(const v1::FabricDescription& description, const std::string& request_id) {
    DirectWorker worker;
    v1::Job job = submit(description, request_id);
    while (job.ended_at_ms() == 0) {
      worker.turn(*scheduler_);
      job = scheduler_->job(job.id());
    }
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.error();
    return job;
  }

  // What a reader sees: version 1 or version 2, whole.
  void expect_whole_version(const std::string& where) {
    const VersionRecord latest = scheduler_->catalogue().find("tiny");
    ASSERT_TRUE(latest.number == 1 || latest.number == 2) << where;
    std::string file;
    scheduler_->catalogue().read(latest, 0, [&](std::string_view bytes) {
      file += bytes;
      return true;
    });
    EXPECT_EQ(core::digest_of(file), latest.content_digest) << where;
    EXPECT_EQ(latest.number == 2, latest.content_digest == reference_) << where;
  }

  // Somebody removes something from the full disk.
  void make_space() {
    made_space_ = disk_.has_struck();
    disk_.disarm();
  }

  // Plays the job with one fault. A scheduler that gives up is torn down and started again.
  void play(std::uint64_t nth, Fault fault) {
    const std::string where =
        "operation " + std::to_string(nth) + ", fault " + std::to_string(static_cast<int>(fault));
    begin("run");
    disk_.arm(nth, fault);
    made_space_ = false;
    DirectWorker worker;
    std::string id;
    for (int starts = 0; starts < 3; ++starts) {
      try {
        open();
        ASSERT_TRUE(id.empty() || scheduler_->job(id).id() == id) << where;
        v1::Job job = submit(recoloured(), "second");
        id = job.id();
        for (int turns = 0; job.ended_at_ms() == 0; ++turns) {
          if (turns == kPatience) {
            make_space();
          }
          worker.turn(*scheduler_);
          expect_whole_version(where);
          job = scheduler_->job(id);
        }
        ASSERT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << where << ": " << job.error();
        break;
      } catch (const std::exception& error) {
        ASSERT_TRUE(disk_.has_struck() || made_space_) << where << ": " << error.what();
        crash(nth);
      }
    }
    if (disk_.has_struck() || made_space_) {
      crash(nth);  // after the fact too: what it had acknowledged is there
      open();
    }
    ASSERT_EQ(scheduler_->job(id).state(), v1::JOB_STATE_SUCCEEDED) << where;
    EXPECT_EQ(scheduler_->catalogue().find("tiny").number, 2U) << where;
    expect_whole_version(where);
    EXPECT_TRUE(worker.given_twice.empty()) << where << ": " << worker.given_twice.front();
    scheduler_.reset();
  }

  void play_all(Fault fault) {
    for (std::uint64_t nth = 1; nth <= operations_ && !HasFatalFailure(); ++nth) {
      play(nth, fault);
    }
  }

  static constexpr int kPatience = 40;  // exchanges

  std::filesystem::path folder_;
  std::filesystem::path state_;
  FaultyDisk disk_;
  core::Digest reference_;
  std::uint64_t operations_ = 0;
  bool made_space_ = false;
  std::unique_ptr<Scheduler> scheduler_;
};

TEST_F(DiskFaults, ErrorAtAnyOperation_LosesNothingThatWasAcknowledged) {
  play_all(Fault::kIoError);
}

TEST_F(DiskFaults, FullDiskFromAnyOperationOn_LosesNothingThatWasAcknowledged) {
  play_all(Fault::kFull);
}

TEST_F(DiskFaults, ShortWriteAtAnyOperation_LosesNothingThatWasAcknowledged) {
  play_all(Fault::kShortWrite);
}

TEST_F(DiskFaults, PowerLossAtAnyOperation_LosesNothingThatWasAcknowledged) {
  play_all(Fault::kPowerLoss);
}

}  // namespace
}  // namespace weft::coordinator
