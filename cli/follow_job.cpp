#include "cli/follow_job.h"

#include <chrono>
#include <cstdio>
#include <thread>

#include "cli/present.h"
#include "cli/progress.h"
#include "core/clock.h"
#include "core/error.h"

namespace weft::cli {

namespace {

// A stream is renewed this often, so that one that hangs is noticed.
constexpr std::chrono::seconds kStreamDeadline{60};
constexpr double kAwayLimitSeconds = 60;
constexpr std::chrono::milliseconds kAwayWait{1000};
// How long a person has to press Ctrl-C a second time.
constexpr double kSecondThoughtSeconds = 3;

bool has_ended(const v1::Job& job) {
  return job.state() == v1::JOB_STATE_SUCCEEDED || job.state() == v1::JOB_STATE_FAILED ||
         job.state() == v1::JOB_STATE_CANCELLED;
}

// Follows one job over as many streams as it takes.
class JobFollower {
 public:
  JobFollower(Client& client, std::string job_id, Interruption& interruption)
      : client_(client),
        job_id_(std::move(job_id)),
        interruption_(interruption),
        printer_(stderr) {}

  v1::Job follow() {
    while (true) {
      const grpc::Status status = watch_once();
      if (has_ended(job_)) {
        printer_.finish(stages_of(job_));
        return job_;
      }
      if (interruption_.requested()) {
        leave();
      }
      if (status.error_code() == grpc::StatusCode::UNAVAILABLE ||
          status.error_code() == grpc::StatusCode::CANCELLED) {  // it stops
        wait_for_coordinator(status);
      } else if (status.error_code() != grpc::StatusCode::DEADLINE_EXCEEDED) {
        client_.check(status, "watch " + job_id_);
        std::this_thread::sleep_for(kAwayWait);  // it ended the stream early: not at once again
      }
    }
  }

 private:
  grpc::Status watch_once() {
    v1::WatchJobRequest request;
    request.set_job_id(job_id_);
    grpc::ClientContext context;
    Client::set_deadline(context, kStreamDeadline);
    const Interruption::Call interruptible(interruption_, context);
    const auto reader = client_.jobs().WatchJob(&context, request);
    v1::WatchJobResponse response;
    while (reader->Read(&response)) {
      if (is_away_) {
        is_away_ = false;
        printer_.note("the coordinator is back");
      }
      job_ = response.job();
      has_seen_job_ = true;
      show();
    }
    return reader->Finish();
  }

  // Ends the following. The job goes on, unless a second Ctrl-C comes soon.
  [[noreturn]] void leave() {
    const std::string way_back =
        "job " + job_id_ + " goes on; 'weft watch " + job_id_ + "' comes back to it";
    if (interruption_.is_by_a_person()) {
      printer_.note(way_back + "; Ctrl-C again cancels it");
      if (interruption_.requested_again_within(kSecondThoughtSeconds)) {
        cancel();
        throw core::Error(core::Code::kCancelled, "job " + job_id_ + " is cancelled; 'weft retry " +
                                                      job_id_ + "' goes on with it");
      }
    }
    throw core::Error(core::Code::kCancelled, "stopped watching; " + way_back);
  }

  void cancel() {
    v1::CancelJobRequest request;
    request.set_request_id(new_request_id());
    request.set_job_id(job_id_);
    (void)client_.call_repeatedly(client_.jobs(), &v1::JobService::Stub::CancelJob, request,
                                  "cancel " + job_id_);
  }

  void show() {
    if (job_.waiting_for() != waiting_for_) {
      waiting_for_ = job_.waiting_for();
      if (!waiting_for_.empty()) {
        printer_.note("waiting for " + waiting_for_);
      }
    }
    for (; troubles_shown_ < job_.troubles_size(); ++troubles_shown_) {
      printer_.note(trouble_text(job_.troubles(troubles_shown_)));
    }
    const std::string audits = audits_text(job_);
    if (!audits.empty() && audits != audits_shown_) {
      audits_shown_ = audits;
      printer_.note(audits);
    }
    if (job_.state() == v1::JOB_STATE_COMMITTING && !is_committing_) {
      is_committing_ = true;
      printer_.note("all results are there; the database is being written");
    }
    printer_.update(stages_of(job_));
  }

  [[nodiscard]] std::string trouble_text(const v1::Trouble& trouble) const {
    const std::string log = trouble.attempt() == 0
                                ? ""
                                : "; weft logs " + job_.id() + " --attempt " +
                                      std::to_string(trouble.attempt()) + " shows its log";
    return trouble.message() + log;
  }

  void wait_for_coordinator(const grpc::Status& status) {
    if (!has_seen_job_) {
      client_.check(status, "watch " + job_id_);
    }
    if (!is_away_) {
      is_away_ = true;
      since_away_ = core::Stopwatch();
      printer_.note("the coordinator is away; the job goes on when it is back");
    }
    if (since_away_.seconds() > kAwayLimitSeconds) {
      client_.check(status, "watch " + job_id_);
    }
    std::this_thread::sleep_for(kAwayWait);
  }

  Client& client_;
  std::string job_id_;
  Interruption& interruption_;
  ProgressPrinter printer_;
  v1::Job job_;
  std::string waiting_for_;
  core::Stopwatch since_away_;
  std::string audits_shown_;
  int troubles_shown_ = 0;
  bool has_seen_job_ = false;
  bool is_away_ = false;
  bool is_committing_ = false;
};

}  // namespace

v1::Job follow_job(Client& client, const std::string& job_id, Interruption& interruption) {
  return JobFollower(client, job_id, interruption).follow();
}

void throw_unless_succeeded(const v1::Job& job) {
  if (job.state() == v1::JOB_STATE_SUCCEEDED) {
    return;
  }
  if (job.state() == v1::JOB_STATE_CANCELLED) {
    throw core::Error(core::Code::kCancelled, "job " + job.id() + " was cancelled");
  }
  throw core::Error(core::Code::kFailedPrecondition, "job " + job.id() + " failed: " + job.error());
}

}  // namespace weft::cli
