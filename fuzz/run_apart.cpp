#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <new>
#include <string>

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "fuzz/library_report.h"
#include "fuzz/target.h"

// The counters of libFuzzer's coverage, which the linker finds; nothing in a build without it.
extern "C" {
extern char __start___sancov_cntrs[] __attribute__((weak));
extern char __stop___sancov_cntrs[] __attribute__((weak));
// AddressSanitizer's, where the program is built with it.
void __asan_set_error_report_callback(void (*callback)(const char*)) __attribute__((weak));
}

// A crash of a library is a signal to the parent; what a sanitizer finds, an exit code of its own.
extern "C" const char* __asan_default_options() {
  return "handle_segv=0:handle_sigbus=0:handle_sigfpe=0:handle_sigill=0:exitcode=77:"
         "detect_leaks=0:detect_container_overflow=0:allocator_may_return_null=1";
}
extern "C" const char* __ubsan_default_options() { return "print_stacktrace=1:exitcode=77"; }

namespace weft::fuzz {

namespace {

constexpr unsigned kSecondsLimit = 20;
constexpr int kUnexpected = 76;
constexpr int kLibraryBroke = 78;

struct Counts {
  unsigned long runs = 0;
  unsigned long crashes = 0;
  unsigned long timeouts = 0;
};
Counts counts;

void report() {
  std::fprintf(stderr,
               "apart: %lu runs, %lu crashes of the library contained, %lu given up after %u s\n",
               counts.runs, counts.crashes, counts.timeouts, kSecondsLimit);
}

std::size_t coverage_bytes() {
  return static_cast<std::size_t>(__stop___sancov_cntrs - __start___sancov_cntrs);
}

// Memory in which a child leaves what it covered.
char* shared_coverage() {
  static char* const shared = [] {
    (void)std::atexit(report);
    const std::size_t bytes = std::max<std::size_t>(1, coverage_bytes());
    void* memory =
        ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) {
      std::abort();
    }
    return static_cast<char*>(memory);
  }();
  return shared;
}

// A library that uses its own memory wrongly would go on or crash without the sanitizer, and is
// contained either way.
void end_if_in_library(const char* report) {
  static const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  if (is_in_library(report, program)) {
    ::_exit(kLibraryBroke);
  }
}

[[noreturn]] void be_child(const std::function<void()>& parse, char* coverage) {
  if (__asan_set_error_report_callback != nullptr) {
    __asan_set_error_report_callback(end_if_in_library);
  }
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGALRM, SIGTERM}) {
    (void)std::signal(signal, SIG_DFL);  // libFuzzer's are the parent's
  }
  ::alarm(kSecondsLimit);
  int code = 0;
  try {
    parse();
  } catch (const core::Error&) {
  } catch (const std::bad_alloc&) {
  } catch (const std::exception& error) {
    std::fprintf(stderr, "an exception that is no core::Error: %s\n", error.what());
    code = kUnexpected;
  }
  std::memcpy(coverage, __start___sancov_cntrs, coverage_bytes());
  ::_exit(code);
}

}  // namespace

void run_apart(const std::function<void()>& parse) {
  char* const coverage = shared_coverage();
  std::memset(coverage, 0, coverage_bytes());
  const pid_t child = ::fork();
  if (child < 0) {
    std::abort();
  }
  if (child == 0) {
    be_child(parse, coverage);
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
  }
  ++counts.runs;
  for (std::size_t i = 0; i < coverage_bytes(); ++i) {
    __start___sancov_cntrs[i] = std::max(__start___sancov_cntrs[i], coverage[i]);
  }
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM) {
    ++counts.timeouts;
  } else if (WIFSIGNALED(status) ? WTERMSIG(status) != SIGABRT
                                 : WEXITSTATUS(status) == kLibraryBroke) {
    ++counts.crashes;
  } else if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    std::fprintf(stderr, "the child ended with status %d\n", status);
    std::abort();
  }
}

}  // namespace weft::fuzz
