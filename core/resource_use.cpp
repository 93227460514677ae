#include "core/resource_use.h"

#include <ctime>

#include <sys/resource.h>

namespace weft::core {

namespace {

double seconds_of(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double& helpers_cpu_seconds() {
  thread_local double seconds = 0;
  return seconds;
}

}  // namespace

double thread_cpu_seconds() { return seconds_of(CLOCK_THREAD_CPUTIME_ID) + helpers_cpu_seconds(); }

void add_thread_cpu_seconds(double helpers_seconds) { helpers_cpu_seconds() += helpers_seconds; }

double process_cpu_seconds() { return seconds_of(CLOCK_PROCESS_CPUTIME_ID); }

std::uint64_t process_peak_bytes() {
  rusage use{};
  getrusage(RUSAGE_SELF, &use);
  return static_cast<std::uint64_t>(use.ru_maxrss) * 1024;
}

}  // namespace weft::core
