#include "core/sandbox.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/sandbox_child.h"

namespace weft::core {

namespace {

constexpr std::size_t kMessageLimitBytes = 4096;

// A descriptor above those that the child gets, closed at the end and not inherited.
class OwnDescriptor {
 public:
  explicit OwnDescriptor(int descriptor) : value_(::fcntl(descriptor, F_DUPFD_CLOEXEC, 16)) {}
  ~OwnDescriptor() {
    if (value_ >= 0) {
      ::close(value_);
    }
  }
  OwnDescriptor(const OwnDescriptor&) = delete;
  OwnDescriptor& operator=(const OwnDescriptor&) = delete;
  OwnDescriptor(OwnDescriptor&&) = delete;
  OwnDescriptor& operator=(OwnDescriptor&&) = delete;
  [[nodiscard]] int value() const { return value_; }

 private:
  int value_;
};

std::string environment_value(const char* name) {
  // No other thread changes the environment: weft never does.
  const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe)
  return value == nullptr ? "" : value;
}

[[noreturn]] void throw_no_child(const std::string& file, int cause) {
  throw Error(Code::kUnavailable, "cannot start the program that reads " + file + ": " +
                                      std::generic_category().message(cause));
}

std::filesystem::path child_program(const char* name, const std::string& file) {
  std::filesystem::path program = folder_of_this_program() / name;
  if (::access(program.c_str(), X_OK) != 0) {
    throw Error(Code::kUnavailable,
                "cannot read " + file + ": there is no " + program.string() +
                    ", the program that reads files which may be hostile; install it there");
  }
  return program;
}

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) {
    pointers.push_back(text.data());
  }
  pointers.push_back(nullptr);
  return pointers;
}

// Starts the child with `input` and `answer` as its descriptors 3 and 4 and no other but
// /dev/null, nothing in its environment that a library listens to, in a process group of its own
// (Ctrl-C is ours to handle), with signals as they are at login.
pid_t spawn(const std::filesystem::path& program, std::vector<std::string> arguments, int input,
            int answer, const std::string& file) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    posix_spawn_file_actions_addopen(&actions, standard, "/dev/null", O_RDWR, 0);
  }
  posix_spawn_file_actions_adddup2(&actions, input, sandbox::kInput);
  posix_spawn_file_actions_adddup2(&actions, answer, sandbox::kAnswer);
  posix_spawn_file_actions_addclosefrom_np(&actions, sandbox::kAnswer + 1);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t signals;
  sigemptyset(&signals);
  posix_spawnattr_setsigmask(&attributes, &signals);
  sigfillset(&signals);
  posix_spawnattr_setsigdefault(&attributes, &signals);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  std::vector<std::string> environment;
  for (const char* name : {"LD_LIBRARY_PATH", "ASAN_OPTIONS", "UBSAN_OPTIONS"}) {
    if (const std::string value = environment_value(name); !value.empty()) {
      environment.push_back(std::string(name) + "=" + value);
    }
  }
  pid_t child = -1;
  const int failure = ::posix_spawn(&child, program.c_str(), &actions, &attributes,
                                    pointers_to(arguments).data(), pointers_to(environment).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (failure != 0) {
    throw_no_child(file, failure);
  }
  return child;
}

// The status of an ended child; nothing to tell when our signals are set to forget children.
int wait_for(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) {
      return 0;
    }
  }
  return status;
}

[[noreturn]] void throw_ended_by(int signal, const std::string& file, const SandboxLimits& limits) {
  if (signal == SIGXCPU || signal == SIGALRM || signal == SIGKILL) {
    throw Error(Code::kResourceExhausted, file + ": reading it was given up after the limit of " +
                                              std::to_string(limits.cpu_s) + " s of computing or " +
                                              std::to_string(limits.memory_bytes >> 20) +
                                              " MiB of memory; no file of its size needs that");
  }
  throw Error(Code::kDataLoss,
              file + " is damaged or hostile: " +
                  (signal == SIGSYS
                       ? "while it was read, what only a program that was led astray does was tried"
                       : "what read it crashed (signal " + std::to_string(signal) + ")") +
                  "; it was read apart, nothing else was touched");
}

// A text from the child, fit for a terminal.
std::string printable(std::string text) {
  text.resize(std::min(text.size(), kMessageLimitBytes));
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const bool is_c1 = i > 0 && text[i - 1] == '\xc2' && c >= 0x80 && c < 0xa0;
    if (c < 0x20 || c == 0x7f || is_c1) {
      text[i] = '?';
    }
  }
  return text;
}

Code code_of(std::uint64_t status) {
  constexpr auto kLast = static_cast<std::uint64_t>(Code::kInternal);
  return status - 1 <= kLast ? static_cast<Code>(status - 1) : Code::kDataLoss;
}

SandboxAnswer mapped(int descriptor, const std::string& file) {
  struct stat held {};
  if (::fstat(descriptor, &held) != 0 || held.st_size < 8) {
    throw Error(Code::kDataLoss, file + ": nothing came back from reading it");
  }
  const auto size = static_cast<std::size_t>(held.st_size);
  void* data = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (data == MAP_FAILED) {
    throw Error(Code::kResourceExhausted, "there is no memory for the contents of " + file + ": " +
                                              std::generic_category().message(errno));
  }
  return {data, size};
}

}  // namespace

SandboxAnswer::~SandboxAnswer() {
  if (data_ != nullptr) {
    ::munmap(const_cast<void*>(data_), size_);
  }
}

SandboxAnswer::SandboxAnswer(SandboxAnswer&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}

std::uint64_t SandboxAnswer::outcome() const { return FlatReader(all()).number(); }

SandboxAnswer read_in_sandbox(const InputFile& file, const std::vector<std::string>& request,
                              const SandboxLimits& limits, const char* program_name) {
  const std::filesystem::path program = child_program(program_name, file.name());
  const int made = ::memfd_create("weft-answer", MFD_CLOEXEC);
  const OwnDescriptor answer(made);
  if (made >= 0) {
    ::close(made);
  }
  const OwnDescriptor input(file.descriptor());
  if (answer.value() < 0 || input.value() < 0) {
    throw_no_child(file.name(), errno);
  }
  const bool is_unsafe = environment_value("WEFT_UNSAFE_OPEN") == "1";
  std::vector<std::string> arguments{program.string(),
                                     request.front(),
                                     std::to_string(limits.memory_bytes),
                                     std::to_string(limits.answer_bytes),
                                     std::to_string(limits.cpu_s),
                                     is_unsafe ? sandbox::kUnsafe : sandbox::kConfined};
  arguments.insert(arguments.end(), request.begin() + 1, request.end());
  const int status =
      wait_for(spawn(program, std::move(arguments), input.value(), answer.value(), file.name()));
  if (WIFSIGNALED(status)) {
    throw_ended_by(WTERMSIG(status), file.name(), limits);
  }
  SandboxAnswer mapping = mapped(answer.value(), file.name());
  if (mapping.outcome() != sandbox::kDone) {
    FlatReader reader(mapping.bytes());
    throw Error(code_of(mapping.outcome()), printable(reader.text()));
  }
  return mapping;
}

std::filesystem::path folder_of_this_program() {
  std::error_code failure;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", failure);
  if (failure) {
    throw Error(Code::kUnavailable, "cannot tell where weft's programs are: " + failure.message());
  }
  return self.parent_path();
}

}  // namespace weft::core
