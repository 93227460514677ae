#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace weft::cli {

// A program started by this one, in a process group of its own so that Ctrl-C reaches only us. It
// gets SIGTERM when the thread that started it ends, however that happens, and is killed and reaped
// by the destructor if it still runs. Of one thread.
class ChildProcess {
 public:
  // Starts `command` (a path, then its arguments) with both outputs appended to `log`, but stdout
  // to us when `reads_stdout`. Throws core::Error(kUnavailable) when it cannot be started.
  ChildProcess(const std::vector<std::string>& command, const std::filesystem::path& log,
               bool reads_stdout);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  ChildProcess(ChildProcess&&) = delete;
  ChildProcess& operator=(ChildProcess&&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }

  // How it ended; nothing while it runs. A signal counts as 128 + its number, as in a shell.
  [[nodiscard]] std::optional<int> exit_code();
  [[nodiscard]] std::optional<int> wait(double seconds);
  // Sends a signal, unless it has ended.
  void signal(int number);

  // The next line of its stdout, without the line break; nothing when it has ended or `seconds`
  // have passed.
  [[nodiscard]] std::optional<std::string> read_line(double seconds);

 private:
  pid_t pid_ = -1;
  int stdout_ = -1;
  std::string unread_;
  std::optional<int> exit_code_;
};

// The folder of the running program, where the project's other programs are too.
[[nodiscard]] std::filesystem::path program_folder();

}  // namespace weft::cli
