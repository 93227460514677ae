#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include <fmt/format.h>
#include <unistd.h>

#include "core/clock.h"
#include "tests/simulation/world.h"

// test_simulation [--first SEED] [--seeds COUNT] [--trace] [--find]
// Plays seeded clusters. Exits with 1 and says how to replay when one goes wrong. --find is for
// planted bugs: the first seed that goes wrong is a success, none is a failure.

namespace {

using weft::simulation::Outcome;

std::uint64_t g_seed = 0;
bool g_finds = false;
const char* g_program = "test_simulation";

void say_failure(const std::string& problem) {
  fmt::print("seed {} goes wrong: {}\n  replay it: {} --first {} --seeds 1 --trace\n", g_seed,
             problem, g_program, g_seed);
  std::fflush(stdout);
}

// A CHECK in the code under test failed, which aborts; or worse.
void on_abort(int /*signal*/) {
  say_failure("the program crashed");
  _exit(g_finds ? 0 : 1);
}

}  // namespace

int main(int argc, char** argv) {
  std::uint64_t first = 1;
  std::uint64_t seeds = 500;
  bool is_traced = false;
  g_program = argv[0];
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const bool has_value = i + 1 < argc;
    if (argument == "--first" && has_value) {
      first = std::strtoull(argv[++i], nullptr, 10);
    } else if (argument == "--seeds" && has_value) {
      seeds = std::strtoull(argv[++i], nullptr, 10);
    } else if (argument == "--trace") {
      is_traced = true;
    } else if (argument == "--find") {
      g_finds = true;
    } else {
      fmt::print(stderr,
                 "unknown argument '{}'; it takes --first SEED, --seeds COUNT, --trace, "
                 "--find\n",
                 argument);
      return 2;
    }
  }
  std::signal(SIGABRT, on_abort);
  std::signal(SIGSEGV, on_abort);
  const weft::core::Stopwatch stopwatch;
  std::uint64_t wrong = 0;
  std::uint64_t events = 0;
  std::uint64_t crashes = 0;
  std::uint64_t databases = 0;
  for (g_seed = first; g_seed < first + seeds; ++g_seed) {
    const Outcome outcome = weft::simulation::run_seed(g_seed, is_traced);
    events += outcome.events;
    crashes += outcome.crashes;
    databases += outcome.databases.size();
    if (!outcome.problem.empty()) {
      ++wrong;
      say_failure(fmt::format("{} (at {:.3f} s)", outcome.problem,
                              static_cast<double>(outcome.at_ms) / 1000));
      if (g_finds) {
        return 0;
      }
    }
  }
  fmt::print("seeds={} wrong={} events={} crashes={} databases={} seconds={:.1f}\n", seeds, wrong,
             events, crashes, databases, stopwatch.seconds());
  return (wrong > 0) != g_finds ? 1 : 0;
}
