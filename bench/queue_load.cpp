#include <cstdio>
#include <string>
#include <vector>

#include <malloc.h>

#include "coordinator/queue/queue.h"
#include "core/clock.h"
#include "core/digest.h"

// The queue alone at the size it must bear: a stage of a million shards and a thousand workers.
// Prints times and memory, and asserts nothing.

namespace weft::coordinator {
namespace {

constexpr std::uint64_t kShards = 1'000'000;
constexpr std::uint64_t kWorkers = 1'000;

std::size_t heap_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

PlannedEvent planned() {
  PlannedEvent event{"job", 0, {}};
  PlannedStage& stage = event.stages.emplace_back();
  stage.name = StageName::kVisibility;
  stage.digests.reserve(kShards);
  for (std::uint64_t i = 0; i < kShards; ++i) {
    stage.digests.push_back(core::digest_of(std::to_string(i)));
  }
  return event;
}

ReportEvent report_of(std::uint64_t worker) {
  ReportEvent report;
  report.worker = std::to_string(worker).append("w");
  report.name = report.worker;
  report.threads = 16;
  report.free_attempts = 2;
  return report;
}

// Reports as workers make them: what they run, or what they completed.
void take(const Reply& reply, ReportEvent& report) {
  for (const AssignAction& assign : reply.assignments) {
    report.running.push_back({assign.job, assign.attempt, assign.token, 0, 0, {}});
  }
}

void complete(const Queue& queue, ReportEvent& report, std::uint64_t* shards) {
  if (report.running.empty()) {
    return;
  }
  const RunningClaim claim = report.running.front();
  report.running.erase(report.running.begin());
  const Attempt& attempt = queue.attempts().at(claim.attempt);
  CompletionClaim completion{claim.job, claim.attempt, claim.token, {}, {}, 0};
  completion.work_ms = 20'000;
  for (std::uint64_t i = 0; i < attempt.shards; ++i) {
    completion.results.push_back(
        {attempt.first_shard + i,
         core::digest_of(std::to_string(attempt.first_shard + i).append("r")), 1});
  }
  *shards += attempt.shards;
  report.completions = {completion};
}

int run() {
  Time now{std::chrono::hours(1)};
  Queue queue({}, 1);
  static_cast<void>(
      queue.apply(SubmitEvent{"job", "fabric", core::Digest{}, now, {}, false, {}}, now));
  std::size_t before = 0;
  {
    const PlannedEvent event = planned();
    before = heap_bytes();
    const core::Stopwatch adding;
    static_cast<void>(queue.apply(event, now));
    std::printf("add a stage of %llu shards   %8.2f s\n", static_cast<unsigned long long>(kShards),
                adding.seconds());
    std::printf("memory per queued shard          %8.0f bytes\n",
                static_cast<double>(heap_bytes() - before) / static_cast<double>(kShards));
  }
  std::vector<ReportEvent> reports;
  for (std::uint64_t w = 0; w < kWorkers; ++w) {
    reports.push_back(report_of(w));
  }
  const core::Stopwatch joining;
  for (ReportEvent& report : reports) {
    take(queue.apply(report, now).reply, report);
  }
  std::printf("first report of a worker         %8.1f us\n",
              joining.seconds() * 1e6 / static_cast<double>(kWorkers));
  const core::Stopwatch beating;
  constexpr int kBeats = 10;
  for (int beat = 0; beat < kBeats; ++beat) {
    now += std::chrono::seconds(1);
    for (ReportEvent& report : reports) {
      static_cast<void>(queue.apply(report, now));
    }
  }
  std::printf("heartbeat of a busy worker       %8.1f us\n",
              beating.seconds() * 1e6 / static_cast<double>(kWorkers * kBeats));
  const core::Stopwatch ticking;
  for (int tick = 0; tick < kBeats; ++tick) {
    now += std::chrono::seconds(1);
    static_cast<void>(queue.apply(TickEvent{}, now));
  }
  std::printf("tick with %llu attempts         %8.1f us\n",
              static_cast<unsigned long long>(queue.attempts().size()),
              ticking.seconds() * 1e6 / kBeats);
  const core::Stopwatch working;
  std::uint64_t shards = 0;
  std::uint64_t calls = 0;
  while (shards < kShards / 2) {
    now += std::chrono::milliseconds(10);
    ReportEvent& report = reports[calls++ % kWorkers];
    complete(queue, report, &shards);
    take(queue.apply(report, now).reply, report);
    report.completions.clear();
  }
  std::printf("completion and new assignment    %8.1f us, of %.0f shards each\n",
              working.seconds() * 1e6 / static_cast<double>(calls),
              static_cast<double>(shards) / static_cast<double>(calls));
  std::printf("memory per shard, half done      %8.0f bytes\n",
              static_cast<double>(heap_bytes() - before) / static_cast<double>(kShards));
  return 0;
}

}  // namespace
}  // namespace weft::coordinator

int main() { return weft::coordinator::run(); }
