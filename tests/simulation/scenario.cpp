#include <algorithm>

#include "core/random.h"
#include "tests/simulation/world.h"

namespace weft::simulation {

namespace {

using core::Random;

bool happens(Random& random, double chance) { return random.uniform() < chance; }

std::uint64_t between(Random& random, std::uint64_t low, std::uint64_t high) {
  return low + random.below(static_cast<std::uint32_t>(high - low + 1));
}

// Each seed has some kinds of fault and not others, so that rare ones meet in all combinations.
Weather weather_of(Random& random) {
  Weather weather;
  const auto sometimes = [&](double chance) { return happens(random, 0.4) ? chance : 0.0; };
  weather.lost_messages = sometimes(0.02 + 0.2 * random.uniform());
  weather.doubled_messages = sometimes(0.1);
  weather.late_messages = sometimes(0.05);
  weather.journal_failures = sometimes(0.005);
  weather.slow_syncs = sometimes(0.2);
  weather.blob_failures = sometimes(0.02);
  weather.forgetful_workers = sometimes(0.2);
  weather.short_resources = sometimes(0.02);
  weather.passing_failures = sometimes(0.01);
  weather.crashes = sometimes(0.001);
  weather.kills = sometimes(0.001);
  return weather;
}

std::vector<Character> machines_of(Random& random) {
  const core::Digest usual = core::digest_of("usual numbers");
  const core::Digest other = core::digest_of("other numbers");
  const bool are_mixed = happens(random, 0.2);
  std::vector<Character> machines(between(random, 2, 6));
  for (std::size_t i = 0; i < machines.size(); ++i) {
    Character& machine = machines[i];
    machine.name = std::string("m").append(std::to_string(i));
    machine.threads = static_cast<unsigned>(between(random, 1, 4));
    machine.slowness = happens(random, 0.15) ? between(random, 3, 15) : 1;
    machine.fingerprint = are_mixed && i % 2 == 1 ? other : usual;
  }
  return machines;
}

std::vector<JobRow> jobs_of(Random& random) {
  std::vector<JobRow> jobs(between(random, 1, 4));
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    JobRow& job = jobs[i];
    job.id = std::string("j").append(std::to_string(i));
    FakeFabric& fabric = job.fabric;
    const std::uint64_t cloth = random.below(2);
    fabric.cloth = cloth == 0 ? "silk" : "wool";
    fabric.colour = std::to_string(random.below(3));
    fabric.name = fabric.cloth + "." + fabric.colour;
    // Of one cloth all jobs share everything but the transfer.
    fabric.visibility_shards = cloth == 0 ? 9 : 5;
    fabric.shadow_shards = cloth == 0 ? 2 : 3;
    fabric.transfer_shards = between(random, 1, 14);
    job.demands.user = random.below(2) == 0 ? "ada" : "ben";
    job.demands.priority = static_cast<std::int32_t>(random.below(3)) - 1;
  }
  return jobs;
}

// One machine that lies, or that fails what others can do; with enough honest ones beside it. Where
// there is a liar, work is audited.
void add_rogue(Random& random, Scenario& scenario) {
  while (scenario.machines.size() < 4) {
    scenario.machines.push_back(scenario.machines.front());
    scenario.machines.back().name =
        std::string("m").append(std::to_string(scenario.machines.size() - 1));
  }
  for (Character& machine : scenario.machines) {
    machine.fingerprint = scenario.machines.front().fingerprint;
  }
  Character& rogue = scenario.machines.back();
  if (happens(random, 0.5)) {
    rogue.fails = happens(random, 0.5) ? StageName::kVisibility : StageName::kTransfer;
    return;
  }
  rogue.lies = true;
  for (JobRow& job : scenario.jobs) {
    job.demands.audit = 1;
  }
  if (happens(random, 0.3)) {
    scenario.jobs.front().demands.audit = 0;  // it may be deceived, the others not
  }
}

// What some machines have and some jobs ask for. The first machine has it all, so that every job
// can end.
void add_demands(Random& random, Scenario& scenario) {
  constexpr std::uint64_t kGib = std::uint64_t{1} << 30;
  const bool needs_memory = happens(random, 0.5);
  for (std::size_t i = 0; i < scenario.machines.size(); ++i) {
    Character& machine = scenario.machines[i];
    machine.fingerprint = scenario.machines.front().fingerprint;
    machine.labels = {"linux"};
    if (i == 0 || happens(random, 0.4)) {
      machine.labels.emplace_back("large");
    }
    machine.memory_bytes = i == 0 || happens(random, 0.5) ? 8 * kGib : 2 * kGib;
    machine.wall_limit_ms = i > 0 && happens(random, 0.4) ? between(random, 70'000, 200'000) : 0;
  }
  for (JobRow& job : scenario.jobs) {
    if (happens(random, 0.5)) {
      job.demands.labels = {"large"};
    }
    job.fabric.transfer_bytes = needs_memory ? 6 * kGib : 0;
  }
}

}  // namespace

Scenario scenario_of(std::uint64_t seed) {
  Random random(seed, 2);
  Scenario scenario;
  constexpr std::uint32_t kLeases[] = {5'000, 10'000, 30'000};
  scenario.settings.lease_ms = kLeases[random.below(3)];
  scenario.settings.hung_ms = 60'000;
  scenario.settings.short_limit_ms = 60'000;
  scenario.weather = weather_of(random);
  scenario.faults_ms = between(random, 20'000, 200'000);
  scenario.trouble_ms = happens(random, 0.7) ? between(random, 2'000, 40'000) : 0;
  scenario.machines = machines_of(random);
  scenario.jobs = jobs_of(random);
  scenario.spoilt_blobs = happens(random, 0.3) ? between(random, 1, 6) : 0;
  scenario.has_clock_jumps = happens(random, 0.2);
  if (happens(random, 0.15)) {
    add_rogue(random, scenario);
  } else if (happens(random, 0.3)) {
    add_demands(random, scenario);
  }
  const double audit = happens(random, 0.2) ? 0.2 + 0.8 * random.uniform() : 0;
  for (JobRow& job : scenario.jobs) {
    job.demands.audit = std::max(job.demands.audit, audit);
  }
  scenario.weather.hung_shards = happens(random, 0.15) ? 0.01 : 0;
  if (happens(random, 0.15)) {
    constexpr const char* kStages[] = {"geometry", "visibility", "transfer"};
    scenario.bad_shards.push_back({random.below(2) == 0 ? "silk" : "wool", kStages[random.below(3)],
                                   0, happens(random, 0.3)});
  }
  return scenario;
}

Scenario calm(Scenario scenario) {
  scenario.weather = {};
  scenario.faults_ms = 0;
  scenario.trouble_ms = 0;
  scenario.bad_shards.clear();
  scenario.spoilt_blobs = 0;
  scenario.has_clock_jumps = false;
  return scenario;
}

}  // namespace weft::simulation
