#include "core/sandbox_child.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <new>
#include <system_error>

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "core/error.h"

// Sanitizers reserve terabytes of address space and are no program for strangers' files.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define WEFT_LIMITS_MEMORY 0
#else
#define WEFT_LIMITS_MEMORY 1
#endif

namespace weft::core {

namespace {

// The program and its libraries themselves.
constexpr std::uint64_t kProgramBytes = std::uint64_t{256} << 20;
// A busy machine: the time on the wall may be this many times that of the processor.
constexpr std::uint64_t kWallPerCpu = 20;

// What parsing needs of the kernel: memory, what is read and written through open descriptors, the
// time, and an end.
constexpr int kAllowed[] = {SYS_read,      SYS_pread64,      SYS_write,         SYS_lseek,
                            SYS_munmap,    SYS_mremap,       SYS_brk,           SYS_madvise,
                            SYS_getrandom, SYS_rt_sigreturn, SYS_clock_gettime, SYS_gettimeofday,
                            SYS_futex,     SYS_sysinfo,      SYS_exit,          SYS_exit_group};

constexpr sock_filter load(std::uint32_t offset) {
  return BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offset);
}

constexpr sock_filter answer_with(std::uint32_t action) {
  return BPF_STMT(BPF_RET | BPF_K, action);
}

// Skips the next statement unless the loaded word equals `value`.
constexpr sock_filter unless_equal_skip(std::uint32_t value) {
  return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1);
}

// Everything that is not allowed ends the process. Memory never becomes executable, and no file can
// be opened: HDF5 tries one before it believes that it shall read from memory.
std::vector<sock_filter> filter() {
  std::vector<sock_filter> program{
      load(offsetof(seccomp_data, arch)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, AUDIT_ARCH_X86_64, 1, 0),
      answer_with(SECCOMP_RET_KILL_PROCESS),
      load(offsetof(seccomp_data, nr)),
  };
  for (const int number : kAllowed) {
    program.push_back(unless_equal_skip(static_cast<std::uint32_t>(number)));
    program.push_back(answer_with(SECCOMP_RET_ALLOW));
  }
  for (const int number : {SYS_open, SYS_openat}) {
    program.push_back(unless_equal_skip(static_cast<std::uint32_t>(number)));
    program.push_back(answer_with(SECCOMP_RET_ERRNO | ENOENT));
  }
  constexpr auto kProtection = static_cast<std::uint32_t>(offsetof(seccomp_data, args[2]));
  for (const int number : {SYS_mmap, SYS_mprotect}) {
    program.push_back(
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(number), 0, 4));
    program.push_back(load(kProtection));
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, PROT_EXEC, 0, 1));
    program.push_back(answer_with(SECCOMP_RET_KILL_PROCESS));
    program.push_back(answer_with(SECCOMP_RET_ALLOW));
  }
  program.push_back(answer_with(SECCOMP_RET_KILL_PROCESS));
  return program;
}

void limit(__rlimit_resource resource, std::uint64_t value) {
  const rlimit both{value, value};
  if (::setrlimit(resource, &both) != 0) {
    throw Error(Code::kUnavailable, "a limit on the program that reads the file cannot be set: " +
                                        std::generic_category().message(errno));
  }
}

struct Request {
  std::uint64_t memory_bytes = 0;
  std::uint64_t answer_bytes = 0;
  std::uint64_t cpu_s = 0;
  bool is_unsafe = false;
  std::vector<std::string> arguments;
};

void confine(const Request& request) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  // What is too long for the answer is an error of write, not a signal.
  (void)std::signal(SIGXFSZ, SIG_IGN);
  if (WEFT_LIMITS_MEMORY != 0) {
    limit(RLIMIT_AS, kProgramBytes + request.memory_bytes);
  }
  limit(RLIMIT_CPU, request.cpu_s);
  limit(RLIMIT_FSIZE, request.answer_bytes);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_NOFILE, 0);
  ::alarm(static_cast<unsigned>(request.cpu_s * kWallPerCpu));
  if (request.is_unsafe) {
    return;
  }
  std::vector<sock_filter> program = filter();
  const sock_fprog handed{static_cast<unsigned short>(program.size()), program.data()};
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
      ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &handed) != 0) {
    throw Error(Code::kUnavailable,
                "this machine does not let a program give up its rights (seccomp: " +
                    std::generic_category().message(errno) +
                    "), so a file that may be hostile is not read; allow seccomp in the container, "
                    "or set WEFT_UNSAFE_OPEN=1 for files that you trust");
  }
}

std::span<const std::byte> input() {
  struct stat held {};
  if (::fstat(sandbox::kInput, &held) != 0) {
    throw Error(Code::kUnavailable, "the file to read was not handed over");
  }
  const auto size = static_cast<std::size_t>(held.st_size);
  if (size == 0) {
    return {};
  }
  // Writable, and private: some libraries take nothing else.
  void* data = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE, sandbox::kInput, 0);
  if (data == MAP_FAILED) {
    throw Error(Code::kResourceExhausted,
                "there is no memory for a file of " + std::to_string(size) + " bytes");
  }
  return {static_cast<const std::byte*>(data), size};
}

void put_outcome(std::uint64_t outcome) {
  ::lseek(sandbox::kAnswer, 0, SEEK_SET);
  FlatWriter writer(sandbox::kAnswer);
  writer.number(outcome);
  writer.flush();
}

void put_error(Code code, const std::string& what) {
  put_outcome(static_cast<std::uint64_t>(code) + 1);
  FlatWriter writer(sandbox::kAnswer);
  writer.text(what);
  writer.flush();
}

void answer(const Request& request, const SandboxHandler& handler) {
  put_error(Code::kDataLoss, "reading the file ended early");  // until it is done
  handler.prepare();
  const std::span<const std::byte> file = input();
  confine(request);
  ::lseek(sandbox::kAnswer, sizeof(std::uint64_t), SEEK_SET);
  FlatWriter writer(sandbox::kAnswer);
  handler.parse(file, request.arguments, writer);
  writer.flush();
  put_outcome(sandbox::kDone);
}

// The whole of `text`; nothing else calls us, so that a mistake is ours.
std::uint64_t number_in(const char* text) { return std::strtoull(text, nullptr, 10); }

}  // namespace

int serve_sandbox(int argc, char** argv, const std::map<std::string, SandboxHandler>& handlers) {
  struct stat held {};
  const auto handler = argc > 1 ? handlers.find(argv[1]) : handlers.end();
  if (argc < sandbox::kFixedArguments || handler == handlers.end() ||
      ::fstat(sandbox::kInput, &held) != 0 || ::fstat(sandbox::kAnswer, &held) != 0) {
    return sandbox::kExitWrongUse;
  }
  Request request{number_in(argv[2]),
                  number_in(argv[3]),
                  number_in(argv[4]),
                  std::string(argv[5]) == sandbox::kUnsafe,
                  {}};
  request.arguments.assign(argv + sandbox::kFixedArguments, argv + argc);
  try {
    answer(request, handler->second);
  } catch (const Error& error) {
    put_error(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    put_error(Code::kResourceExhausted, "reading the file needs more than the limit of " +
                                            std::to_string(request.memory_bytes >> 20) +
                                            " MiB of memory");
  } catch (const std::exception& error) {
    put_error(Code::kDataLoss, std::string("the file cannot be read: ") + error.what());
  }
  // No destructor of a library that was led astray runs any more.
  ::_exit(0);
}

}  // namespace weft::core
