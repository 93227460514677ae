#include "tests/simulation/world.h"

// What people and accidents do to the cluster.

namespace weft::simulation {

using namespace coordinator;

void World::arrange_jobs() {
  for (const JobRow& job : scenario_.jobs) {
    ground_.timeline.after(ground_.between(0, 60'000), [this, job] {
      client_.submit(job, [this, id = job.id] { arrange_orders(id); });
    });
  }
}

// Some jobs are paused for a while, some are cancelled, some are urgent all of a sudden, some are
// tried again.
void World::arrange_orders(const std::string& job) {
  const std::uint64_t wait_ms = ground_.between(0, 60'000);
  const bool is_paused = ground_.happens(0.2);
  const bool is_cancelled = !is_paused && ground_.happens(0.12);
  if (is_paused) {
    ground_.timeline.after(wait_ms, [this, job] {
      client_.pause(job, true, [this, job] {
        ground_.timeline.after(ground_.between(0, 60'000),
                               [this, job] { client_.pause(job, false, [] {}); });
      });
    });
  } else if (is_cancelled) {
    ground_.timeline.after(wait_ms, [this, job, is_regretted = ground_.happens(0.5)] {
      client_.cancel(job, [this, job, is_regretted] {
        if (is_regretted) {
          ground_.timeline.after(ground_.between(0, 30'000),
                                 [this, job] { client_.retry(job, [] {}); });
        }
      });
    });
  } else if (ground_.happens(0.2)) {
    ground_.timeline.after(wait_ms, [this, job] { client_.prioritise(job, 50, [] {}); });
  }
  if (!is_cancelled && !is_paused && ground_.happens(0.3)) {  // in case it has failed
    ground_.timeline.after(ground_.between(20'000, 150'000),
                           [this, job] { client_.retry(job, [] {}); });
  }
}

void World::arrange_drains() {
  if (ground_.happens(0.2)) {
    const std::string name = scenario_.machines.front().name;
    ground_.timeline.after(ground_.between(0, 60'000), [this, name] {
      client_.drain(name, true, [this, name] {
        ground_.timeline.after(ground_.between(0, 60'000),
                               [this, name] { client_.drain(name, false, [] {}); });
      });
    });
  }
  const Character& last = scenario_.machines.back();
  if ((last.lies || last.fails) && ground_.happens(0.5)) {
    // Somebody believes that it is mended.
    const StageName stage = last.fails.value_or(StageName::kVisibility);
    ground_.timeline.after(ground_.between(20'000, 150'000), [this, name = last.name, stage] {
      client_.unblock(name, stage, [] {});
    });
  }
}

void World::arrange_trouble() {
  if (scenario_.trouble_ms > 0) {
    ground_.timeline.after(ground_.between(1, scenario_.trouble_ms), [this] {
      if (!is_calm_) {
        blow();
        arrange_trouble();
      }
    });
  }
}

// One accident.
void World::blow() {
  Machine& machine = *machines_[ground_.between(0, machines_.size() - 1)];
  switch (ground_.between(0, 7)) {
    case 0:
      crash_coordinator();
      break;
    case 1:
      machine.kill();
      break;
    case 2:
      machine.leave();
      break;
    case 3:
      machine.freeze(ground_.between(100, 60'000));
      break;
    case 4:
      machine.cut_off(ground_.between(100, 60'000));
      break;
    case 5:
      for (const auto& other : machines_) {  // the power goes
        other->kill();
      }
      crash_coordinator();
      break;
    case 6:
      if (spoilt_ < scenario_.spoilt_blobs) {
        ++spoilt_;
        const auto blob = coordinator_.blobs().spoil(ground_.random.bits(), ground_.happens(0.5));
        ground_.say("blob {} is spoilt", blob ? blob->hex().substr(0, 8) : "(none)");
      }
      break;
    default:
      if (scenario_.has_clock_jumps) {
        const auto jump_ms = static_cast<std::int64_t>(ground_.between(0, 7'200'000)) - 3'600'000;
        ground_.say("the coordinator's clock jumps by {} ms", jump_ms);
        coordinator_.set_clock(coordinator_.clock_offset_ms() + jump_ms);
      }
  }
}

}  // namespace weft::simulation
