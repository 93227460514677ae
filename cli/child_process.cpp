#include "cli/child_process.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/clock.h"
#include "core/error.h"
#include "core/sandbox.h"

namespace weft::cli {

namespace {

constexpr std::chrono::milliseconds kPoll{20};
constexpr int kCannotExecute = 127;

[[noreturn]] void throw_errno(const std::string& what) {
  throw core::Error(core::Code::kUnavailable,
                    "cannot " + what + ": " + std::generic_category().message(errno));
}

// What happens in the child between fork and exec: only calls that are safe there.
[[noreturn]] void become(char* const* arguments, pid_t parent, int out, int err) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) {
    ::_exit(kCannotExecute);  // the parent ended before the line above
  }
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::dup2(out, STDOUT_FILENO);
  ::dup2(err, STDERR_FILENO);
  const int nothing = ::open("/dev/null", O_RDONLY);
  if (nothing >= 0) {
    ::dup2(nothing, STDIN_FILENO);
  }
  ::execv(arguments[0], arguments);
  ::_exit(kCannotExecute);
}

}  // namespace

ChildProcess::ChildProcess(const std::vector<std::string>& command,
                           const std::filesystem::path& log, bool reads_stdout) {
  const int log_file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (log_file < 0) {
    throw_errno("write " + log.string());
  }
  std::array<int, 2> pipe{-1, -1};
  if (reads_stdout && ::pipe2(pipe.data(), O_CLOEXEC) != 0) {
    ::close(log_file);
    throw_errno("make a pipe");
  }
  std::vector<std::string> copies = command;
  std::vector<char*> arguments;
  for (std::string& argument : copies) {
    arguments.push_back(argument.data());
  }
  arguments.push_back(nullptr);
  const pid_t parent = ::getpid();
  pid_ = ::fork();
  if (pid_ == 0) {
    become(arguments.data(), parent, reads_stdout ? pipe[1] : log_file, log_file);
  }
  const int cause = errno;
  ::close(log_file);
  if (reads_stdout) {
    ::close(pipe[1]);
    stdout_ = pipe[0];
  }
  if (pid_ < 0) {
    if (stdout_ >= 0) {
      ::close(stdout_);
    }
    errno = cause;
    throw_errno("start " + command.front());
  }
  ::setpgid(pid_, pid_);  // here too, so that it has happened whoever comes first
}

ChildProcess::~ChildProcess() {
  if (!exit_code()) {
    ::kill(pid_, SIGKILL);
    (void)::waitpid(pid_, nullptr, 0);
  }
  if (stdout_ >= 0) {
    ::close(stdout_);
  }
}

std::optional<int> ChildProcess::exit_code() {
  int status = 0;
  if (!exit_code_ && ::waitpid(pid_, &status, WNOHANG) == pid_) {
    exit_code_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  }
  return exit_code_;
}

std::optional<int> ChildProcess::wait(double seconds) {
  const core::Stopwatch since_start;
  while (!exit_code() && since_start.seconds() < seconds) {
    std::this_thread::sleep_for(kPoll);
  }
  return exit_code();
}

void ChildProcess::signal(int number) {
  if (!exit_code()) {
    ::kill(pid_, number);
  }
}

std::optional<std::string> ChildProcess::read_line(double seconds) {
  const core::Stopwatch since_start;
  while (true) {
    const std::size_t end = unread_.find('\n');
    if (end != std::string::npos) {
      std::string line = unread_.substr(0, end);
      unread_.erase(0, end + 1);
      return line;
    }
    const double left = seconds - since_start.seconds();
    pollfd waited{stdout_, POLLIN, 0};
    if (left <= 0 || ::poll(&waited, 1, static_cast<int>(left * 1000) + 1) < 0) {
      return std::nullopt;
    }
    if (waited.revents == 0) {
      continue;
    }
    std::array<char, 4096> buffer{};
    const ssize_t count = ::read(stdout_, buffer.data(), buffer.size());
    if (count <= 0) {
      return std::nullopt;
    }
    unread_.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

std::filesystem::path program_folder() { return core::folder_of_this_program(); }

}  // namespace weft::cli
