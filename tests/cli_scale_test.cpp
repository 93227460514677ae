#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cli/slurm.h"
#include "cli/wanted_workers.h"

namespace weft::cli {
namespace {

v1::StageProgress stage(const std::string& name, std::uint64_t shards, std::uint64_t done) {
  v1::StageProgress progress;
  progress.set_name(name);
  progress.set_state(v1::STAGE_STATE_RUNNING);
  progress.set_shards(shards);
  progress.set_shards_done(done);
  progress.set_seconds_left(-1);
  return progress;
}

v1::Job job_of(const std::vector<v1::StageProgress>& stages) {
  v1::Job job;
  job.set_id("j000000000001");
  for (const v1::StageProgress& one : stages) {
    *job.add_stages() = one;
  }
  return job;
}

v1::Worker at_work(const v1::Job& job, const std::string& stage_name, std::uint32_t threads) {
  v1::Worker worker;
  worker.set_threads(threads);
  v1::WorkerAttempt& attempt = *worker.add_attempts();
  attempt.mutable_name()->set_job_id(job.id());
  attempt.set_stage(stage_name);
  return worker;
}

constexpr ScaleLimits kLimits{0, 20, 4, 60};

TEST(WantedWorkers, NothingToDoWantsTheFewest) {
  EXPECT_EQ(wanted_workers({}, {}, 0, kLimits), 0U);
  EXPECT_EQ(wanted_workers({}, {}, 9, {2, 20, 4, 60}), 2U);
  const std::vector<v1::Job> done{job_of({stage("grid", 1, 1)})};
  EXPECT_EQ(wanted_workers(done, {}, 1, kLimits), 0U);
}

TEST(WantedWorkers, AStageOfOneShardWantsOneWorker) {
  const std::vector<v1::Job> jobs{job_of({stage("geometry", 1, 0)})};
  EXPECT_EQ(wanted_workers(jobs, {}, 0, kLimits), 1U);
  EXPECT_EQ(wanted_workers(jobs, {}, 7, kLimits), 1U);
}

TEST(WantedWorkers, AnUnknownRateDoublesTheWorkersUpToTheMost) {
  const std::vector<v1::Job> jobs{job_of({stage("transfer", 9000, 0)})};
  EXPECT_EQ(wanted_workers(jobs, {}, 0, kLimits), 1U);
  EXPECT_EQ(wanted_workers(jobs, {}, 1, kLimits), 2U);
  EXPECT_EQ(wanted_workers(jobs, {}, 6, kLimits), 12U);
  EXPECT_EQ(wanted_workers(jobs, {}, 16, kLimits), 20U);
}

TEST(WantedWorkers, AKnownRateWantsWorkForEachThread) {
  std::vector<v1::Job> jobs{job_of({stage("transfer", 9000, 100)})};
  jobs[0].mutable_stages(0)->set_seconds_left(600);
  // Two workers of four threads need 600 s: 4,800 s of threads, 80 threads of a minute each.
  const std::vector<v1::Worker> workers{at_work(jobs[0], "transfer", 4),
                                        at_work(jobs[0], "transfer", 4)};
  EXPECT_EQ(wanted_workers(jobs, workers, 2, kLimits), 20U);
  EXPECT_EQ(wanted_workers(jobs, workers, 2, {0, 100, 4, 120}), 10U);
  jobs[0].mutable_stages(0)->set_seconds_left(10);
  EXPECT_EQ(wanted_workers(jobs, workers, 2, kLimits), 1U);
}

TEST(WantedWorkers, AJobThatIsNotPlannedYetWantsOne) {
  std::vector<v1::Job> jobs{job_of({})};
  jobs[0].set_state(v1::JOB_STATE_QUEUED);
  EXPECT_EQ(wanted_workers(jobs, {}, 0, kLimits), 1U);
}

TEST(WantedWorkers, PausedJobsWantNone) {
  std::vector<v1::Job> jobs{job_of({stage("transfer", 9000, 0)})};
  jobs[0].set_paused(true);
  EXPECT_EQ(wanted_workers(jobs, {}, 3, kLimits), 0U);
}

TEST(SlurmWorkers, AreOneArrayWhoseCommandSurvivesTheShell) {
  SlurmWorkers workers;
  workers.job_name = "weft-worker";
  workers.command = {"/opt/we ft/weft-worker", "--label", "it's"};
  workers.name_prefix = "slurm";
  workers.threads = 8;
  workers.minutes = 90;
  workers.warning_seconds = 30;
  workers.output = "/dev/null";
  workers.extra = {"--partition=render"};
  const std::vector<std::string> arguments = sbatch_arguments(workers, 3);
  for (const char* expected : {"--array=1-3", "--cpus-per-task=8", "--time=90",
                               "--signal=B:TERM@30", "--partition=render"}) {
    EXPECT_NE(std::find(arguments.begin(), arguments.end(), expected), arguments.end()) << expected;
  }
  EXPECT_EQ(arguments.back(),
            "--wrap=exec '/opt/we ft/weft-worker' '--label' 'it'\\''s' --name "
            "'slurm'-\"$SLURM_ARRAY_JOB_ID\"-\"$SLURM_ARRAY_TASK_ID\"");
}

}  // namespace
}  // namespace weft::cli
