#include "tests/simulation/world.h"

#include <algorithm>
#include <exception>

#include "core/check.h"

namespace weft::simulation {

using namespace coordinator;

namespace {

constexpr std::uint64_t kPatienceMs = 40 * 60'000;  // after the faults
constexpr std::uint64_t kStepLimit = 3'000'000;
constexpr std::uint64_t kStepsPerMsLimit = 20'000;

}  // namespace

World::World(std::uint64_t seed, Scenario scenario, bool is_traced)
    : scenario_(std::move(scenario)),
      ground_(seed, is_traced),
      checks_(ground_, scenario_.settings),
      coordinator_(ground_, checks_, scenario_.settings),
      client_(ground_, checks_, coordinator_) {
  for (const Character& character : scenario_.machines) {
    machines_.push_back(
        std::make_unique<Machine>(ground_, checks_, coordinator_, character, scenario_.bad_shards));
  }
}

Outcome World::run() {
  Outcome outcome;
  try {
    ground_.weather = scenario_.weather;
    coordinator_.start();
    for (const auto& machine : machines_) {
      ground_.timeline.after(ground_.between(0, 3'000), [&machine] { machine->start(); });
    }
    arrange_jobs();
    arrange_drains();
    arrange_trouble();
    watch();
    ground_.timeline.after(scenario_.faults_ms, [this] { calm_down(); });
    while (!is_over()) {
      step();
    }
    check_ends();
  } catch (const Violation& violation) {
    outcome.problem = violation.what();
  }
  outcome.at_ms = ground_.timeline.now_ms();
  outcome.events = checks_.events();
  outcome.crashes = crashes_;
  for (const auto& [id, job] : coordinator_.journal().durable().jobs) {
    if (job.database) {
      outcome.databases[id] = *job.database;
    }
  }
  return outcome;
}

void World::step() {
  const std::uint64_t before_ms = ground_.timeline.now_ms();
  ground_.timeline.step();
  ++steps_;
  steps_in_ms_ = before_ms == ground_.timeline.now_ms() ? steps_in_ms_ + 1 : 0;
  if (steps_ > kStepLimit || steps_in_ms_ > kStepsPerMsLimit) {
    throw Violation("the cluster spins: things happen without end and time does not pass");
  }
  if (ground_.happens(ground_.weather.crashes)) {
    crash_coordinator();
  }
  if (ground_.happens(ground_.weather.kills)) {
    machines_[ground_.between(0, machines_.size() - 1)]->kill();
  }
}

void World::crash_coordinator() {
  crashes_ += coordinator_.is_up() ? 1 : 0;
  coordinator_.crash();
}

// Once a second: what died is started again after a while, and the promises are looked at.
void World::watch() {
  if (!coordinator_.is_up() && !will_start_) {
    will_start_ = true;
    ground_.timeline.after(is_calm_ ? 0 : ground_.between(0, 25'000), [this] {
      will_start_ = false;
      if (!coordinator_.is_up()) {
        coordinator_.start();
      }
    });
  }
  for (const auto& machine : machines_) {
    if (!machine->is_up() && (is_calm_ || ground_.happens(0.05))) {
      machine->start();
    }
  }
  checks_.check_promises(coordinator_.journal().durable(), nullptr);
  check_progress();
  ground_.timeline.after(1'000, [this] { watch(); });
}

void World::calm_down() {
  ground_.say("the faults are over");
  is_calm_ = true;
  ground_.weather = {};
  for (const auto& machine : machines_) {
    machine->mend();
  }
}

bool World::is_over() const {
  if (!is_calm_ || client_.waiting() > 0 || !coordinator_.is_up()) {
    return false;
  }
  const Tables& durable = coordinator_.journal().durable();
  const bool have_ended = durable.jobs.size() == scenario_.jobs.size() &&
                          std::all_of(durable.jobs.begin(), durable.jobs.end(),
                                      [](const auto& job) { return job.second.end != End::kNone; });
  const bool are_idle = std::all_of(machines_.begin(), machines_.end(),
                                    [](const auto& machine) { return machine->is_idle(); });
  if (have_ended && are_idle) {
    return true;
  }
  if (ground_.timeline.now_ms() > scenario_.faults_ms + kPatienceMs) {
    for (const auto& [id, job] : durable.jobs) {
      if (job.end == End::kNone) {
        throw Violation(id + " does not end though the faults are over: " +
                        stuck_reason(*coordinator_.queue()->job(id)));
      }
    }
    throw Violation("the jobs have ended and workers are not done with them");
  }
  return false;
}

void World::check_ends() const {
  const Tables& durable = coordinator_.journal().durable();
  checks_.check_promises(durable, coordinator_.queue());
  if (!coordinator_.queue()->attempts().empty()) {
    throw Violation("all jobs have ended and there are attempts");
  }
  const bool has_liar = std::any_of(scenario_.machines.begin(), scenario_.machines.end(),
                                    [](const Character& machine) { return machine.lies; });
  for (const auto& [id, job] : durable.jobs) {
    const bool is_bad = std::any_of(
        scenario_.bad_shards.begin(), scenario_.bad_shards.end(),
        [&, &cloth = job.fabric.cloth](const BadShard& bad) { return bad.cloth == cloth; });
    switch (job.end) {
      case End::kSucceeded:
        if (job.database != undisturbed(job.fabric, *job.fingerprint) &&
            !(has_liar && (job.demands.audit < 1 || checks_.is_unaudited(id)))) {
          throw Violation(id + "'s database is not the one of a cluster without faults");
        }
        if (is_bad) {
          throw Violation(id + " succeeded, which one of its shards cannot");
        }
        break;
      case End::kFailed:
        if (!is_bad &&
            !(has_liar && job.error.find("has different results") != std::string::npos) &&
            !checks_.is_rightly_given_up(id)) {
          throw Violation(id + " was given up for no good reason: " + job.error);
        }
        if (job.error.empty()) {
          throw Violation(id + " failed and does not say why");
        }
        break;
      case End::kCancelled:
        if (!client_.cancelled().contains(id)) {
          throw Violation(id + " was cancelled and nobody asked for it");
        }
        break;
      case End::kNone:
        throw Violation(id + " has not ended");
    }
  }
}

Outcome run_seed(std::uint64_t seed, bool is_traced) {
  return World(seed, scenario_of(seed), is_traced).run();
}

}  // namespace weft::simulation
