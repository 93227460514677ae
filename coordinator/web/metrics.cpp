#include "coordinator/web/metrics.h"

#include <mutex>
#include <sstream>
#include <unordered_map>

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include "core/version.h"

namespace weft::coordinator {

namespace {

using prometheus::BuildCounter;
using prometheus::BuildGauge;
using prometheus::BuildHistogram;

const prometheus::Histogram::BucketBoundaries kAttemptSeconds = {0.1, 0.3, 1,   3,    10,
                                                                 30,  100, 300, 1000, 3000};
const prometheus::Histogram::BucketBoundaries kJobSeconds = {1,    10,   60,    300,   900,
                                                             3600, 7200, 21600, 86400, 604800};
const prometheus::Histogram::BucketBoundaries kRequestSeconds = {0.001, 0.003, 0.01, 0.03, 0.1,
                                                                 0.3,   1,     3,    10};

constexpr Outcome kOutcomes[] = {Outcome::kSucceeded, Outcome::kFailed,     Outcome::kLost,
                                 Outcome::kHung,      Outcome::kSuperseded, Outcome::kStopped};

const char* state_label(v1::JobState state) {
  switch (state) {
    case v1::JOB_STATE_SUCCEEDED:
      return "succeeded";
    case v1::JOB_STATE_FAILED:
      return "failed";
    default:
      return "cancelled";
  }
}

template <class Kind, class... Arguments>
Kind& labelled(prometheus::Family<Kind>& family, const char* label, const std::string& value,
               const Arguments&... arguments) {
  return family.Add(prometheus::Labels{{label, value}}, arguments...);
}

}  // namespace

struct Metrics::Families {
  struct Begun {
    StageName stage = StageName::kGeometry;
    std::int64_t at_ms = 0;
  };

  prometheus::Registry registry;
  std::mutex mutex;                                // guards begun
  std::unordered_map<std::uint64_t, Begun> begun;  // attempts, by number

  prometheus::Family<prometheus::Counter>& counter(const char* name, const char* help) {
    return BuildCounter().Name(name).Help(help).Register(registry);
  }
  prometheus::Family<prometheus::Gauge>& gauge(const char* name, const char* help) {
    return BuildGauge().Name(name).Help(help).Register(registry);
  }
  prometheus::Family<prometheus::Histogram>& histogram(const char* name, const char* help) {
    return BuildHistogram().Name(name).Help(help).Register(registry);
  }

  // What happened.
  prometheus::Family<prometheus::Counter>& attempts =
      counter("weft_attempts_total", "Attempts at runs of shards that have ended, by outcome.");
  prometheus::Counter& results =
      counter("weft_results_total", "Results of shards that were recorded.").Add({});
  prometheus::Counter& result_bytes =
      counter("weft_result_bytes_total", "Bytes of the results that were recorded.").Add({});
  prometheus::Counter& mismatches =
      counter("weft_mismatches_total", "Pairs of different results of one shard.").Add({});
  prometheus::Family<prometheus::Histogram>& attempt_seconds =
      histogram("weft_attempt_seconds", "Wall time of attempts that succeeded, by stage.");
  prometheus::Family<prometheus::Counter>& jobs_ended =
      counter("weft_jobs_ended_total", "Jobs that have ended, by how.");
  prometheus::Family<prometheus::Histogram>& job_seconds =
      histogram("weft_job_seconds", "Wall time of jobs from submission to their end, by how.");
  prometheus::Family<prometheus::Counter>& requests =
      counter("weft_page_requests_total", "Requests to the page that were answered, by status.");
  prometheus::Histogram& request_seconds =
      histogram("weft_page_request_seconds", "Time to answer a request to the page.")
          .Add({}, kRequestSeconds);
  prometheus::Family<prometheus::Histogram>& swatch_seconds = histogram(
      "weft_swatch_seconds", "Time that the render node took for a swatch, its queue included.");

  // What is.
  prometheus::Family<prometheus::Gauge>& shards =
      gauge("weft_queue_shards", "Shards of unfinished jobs, by stage and state.");
  prometheus::Gauge& runnable =
      gauge("weft_queue_runnable_shards",
            "Shards that wait or run, and results to be confirmed: so many threads have something "
            "to do at once. Paused jobs do not count.")
          .Add({});
  prometheus::Gauge& work_seconds =
      gauge("weft_queue_work_seconds",
            "Seconds of one thread that the waiting shards will take, of the stages of which a "
            "shard was measured. Paused jobs do not count.")
          .Add({});
  prometheus::Family<prometheus::Gauge>& jobs =
      gauge("weft_jobs", "Unfinished jobs, by state; paused ones are counted in both.");
  prometheus::Family<prometheus::Gauge>& workers =
      gauge("weft_workers", "Workers, by condition; idle, drained and blocked ones are live ones.");
  prometheus::Gauge& threads = gauge("weft_worker_threads", "Threads of the live workers.").Add({});
  prometheus::Family<prometheus::Gauge>& store_bytes =
      gauge("weft_store_bytes", "Bytes on the coordinator's disk, counted every five minutes.");
  prometheus::Gauge& disk_free =
      gauge("weft_disk_free_bytes", "Bytes free in the state folder's file system.").Add({});
  prometheus::Gauge& streams = gauge("weft_page_streams", "Browsers that watch the page.").Add({});
  prometheus::Gauge& healthy =
      gauge("weft_coordinator_healthy", "1 while the journal can be written.").Add({});

  void take(const Actions& actions) {
    const std::lock_guard lock(mutex);
    for (const AttemptRecord& attempt : actions.attempts_begun) {
      begun[attempt.attempt] = {attempt.stage, attempt.began_at_ms};
    }
    for (const AttemptEndRecord& end : actions.attempts_ended) {
      labelled(attempts, "outcome", to_string(end.outcome)).Increment();
      const auto beginning = begun.find(end.attempt);
      if (beginning == begun.end()) {
        continue;  // it began before the coordinator's last start
      }
      if (end.outcome == Outcome::kSucceeded) {
        labelled(attempt_seconds, "stage", to_string(beginning->second.stage), kAttemptSeconds)
            .Observe(static_cast<double>(end.ended_at_ms - beginning->second.at_ms) / 1000);
      }
      begun.erase(beginning);
    }
    results.Increment(static_cast<double>(actions.results.size()));
    for (const ResultRecord& result : actions.results) {
      result_bytes.Increment(static_cast<double>(result.size_bytes));
    }
    mismatches.Increment(static_cast<double>(actions.mismatches.size()));
  }
  void take(const v1::Job& job) {
    labelled(jobs_ended, "state", state_label(job.state())).Increment();
    labelled(job_seconds, "state", state_label(job.state()), kJobSeconds)
        .Observe(static_cast<double>(job.ended_at_ms() - job.submitted_at_ms()) / 1000);
  }
  void take(const Census& census) {
    for (const auto& [stage, count] : census.shards) {
      const auto set = [&, name = to_string(stage)](const char* state, std::uint64_t value) {
        shards.Add(prometheus::Labels{{"stage", name}, {"state", state}})
            .Set(static_cast<double>(value));
      };
      set("waiting", count.waiting);
      set("running", count.running);
      set("done", count.done);
      set("quarantined", count.quarantined);
      set("awaiting_audit", count.awaiting_audit);
    }
    runnable.Set(static_cast<double>(census.runnable_shards));
    work_seconds.Set(census.work_seconds);
    labelled(jobs, "state", "queued").Set(static_cast<double>(census.jobs_queued));
    labelled(jobs, "state", "running").Set(static_cast<double>(census.jobs_running));
    labelled(jobs, "state", "committing").Set(static_cast<double>(census.jobs_committing));
    labelled(jobs, "state", "paused").Set(static_cast<double>(census.jobs_paused));
    labelled(workers, "condition", "live").Set(static_cast<double>(census.workers_live));
    labelled(workers, "condition", "idle").Set(static_cast<double>(census.workers_idle));
    labelled(workers, "condition", "drained").Set(static_cast<double>(census.workers_drained));
    labelled(workers, "condition", "blocked").Set(static_cast<double>(census.workers_blocked));
    labelled(workers, "condition", "lost").Set(static_cast<double>(census.workers_lost));
    threads.Set(static_cast<double>(census.threads));
  }
};

Metrics::Metrics() : families_(std::make_unique<Families>()) {
  // So that rates are known from the first event on.
  for (const Outcome outcome : kOutcomes) {
    labelled(families_->attempts, "outcome", to_string(outcome));
  }
  for (const char* state : {"succeeded", "failed", "cancelled"}) {
    labelled(families_->jobs_ended, "state", state);
  }
  families_->gauge("weft_build_info", "Always 1; the version is its label.")
      .Add(prometheus::Labels{{"version", core::version()}})
      .Set(1);
}

Metrics::~Metrics() = default;

SchedulerHooks Metrics::hooks() {
  return {[this](const Actions& actions) { families_->take(actions); },
          [this](const v1::Job& job) { families_->take(job); }};
}

void Metrics::request_answered(int status, double seconds) {
  labelled(families_->requests, "status", std::to_string(status)).Increment();
  families_->request_seconds.Observe(seconds);
}

void Metrics::swatch_drawn(bool is_thumbnail, double seconds) {
  labelled(families_->swatch_seconds, "kind", is_thumbnail ? "thumbnail" : "turned",
           kRequestSeconds)
      .Observe(seconds);
}

std::string Metrics::text(const Now& now) {
  families_->take(now.census);
  if (now.disk) {
    labelled(families_->store_bytes, "store", "results")
        .Set(static_cast<double>(now.disk->results));
    labelled(families_->store_bytes, "store", "versions")
        .Set(static_cast<double>(now.disk->pieces));
    labelled(families_->store_bytes, "store", "trash").Set(static_cast<double>(now.disk->trash));
  }
  labelled(families_->store_bytes, "store", "journal").Set(static_cast<double>(now.journal_bytes));
  families_->disk_free.Set(static_cast<double>(now.disk_free_bytes));
  families_->streams.Set(now.streams);
  families_->healthy.Set(now.has_problem ? 0 : 1);
  std::ostringstream out;
  prometheus::TextSerializer().Serialize(out, families_->registry.Collect());
  return out.str();
}

}  // namespace weft::coordinator
