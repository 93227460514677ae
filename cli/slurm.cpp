#include "cli/slurm.h"

#include <cctype>
#include <optional>
#include <sstream>

#include <fmt/format.h>

#include "cli/child_process.h"
#include "core/error.h"

namespace weft::cli {

namespace {

constexpr double kCommandSeconds = 60;
constexpr int kNoSuchProgram = 127;

// For a POSIX shell.
std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) {
    text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  }
  return text + "'";
}

// Runs one of Slurm's commands to its end and returns its lines; what it complains of comes with
// them, and is what is told when it fails.
std::vector<std::string> lines_of(const std::vector<std::string>& arguments) {
  std::vector<std::string> command{"/bin/sh", "-c", "exec \"$@\" 2>&1", "sh"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  ChildProcess child(command, "/dev/null", true);
  std::vector<std::string> lines;
  while (std::optional<std::string> line = child.read_line(kCommandSeconds)) {
    lines.push_back(*std::move(line));
  }
  const std::optional<int> code = child.wait(kCommandSeconds);
  if (code == kNoSuchProgram) {
    throw core::Error(core::Code::kFailedPrecondition,
                      arguments.front() +
                          " is not installed here; run this command on a machine "
                          "from which jobs are submitted to Slurm");
  }
  if (code != 0) {
    std::string words;
    for (const std::string& line : lines) {
      words += (words.empty() ? ": " : "; ") + line;
    }
    throw core::Error(core::Code::kUnavailable,
                      arguments.front() + (code ? " failed" : " does not answer") + words);
  }
  return lines;
}

}  // namespace

SlurmQueue slurm_queue(const std::string& job_name) {
  SlurmQueue queue;
  for (const std::string& line :
       lines_of({"squeue", "--me", "--noheader", "--array", "--name=" + job_name,
                 "--states=PENDING,CONFIGURING,RUNNING", "--format=%i %T"})) {
    std::istringstream words(line);
    std::string id;
    std::string state;
    words >> id >> state;
    if (id.empty() || std::isdigit(static_cast<unsigned char>(id.front())) == 0) {
      continue;  // a remark of squeue
    }
    (state == "PENDING" ? queue.waiting : queue.running).push_back(id);
  }
  return queue;
}

std::vector<std::string> sbatch_arguments(const SlurmWorkers& workers, std::uint32_t count) {
  std::string script = "exec";
  for (const std::string& word : workers.command) {
    script.append(" ").append(quoted(word));
  }
  if (!workers.name_prefix.empty()) {
    script += fmt::format(" --name {}-\"$SLURM_ARRAY_JOB_ID\"-\"$SLURM_ARRAY_TASK_ID\"",
                          quoted(workers.name_prefix));
  }
  std::vector<std::string> arguments{
      "sbatch",
      "--parsable",
      "--job-name=" + workers.job_name,
      fmt::format("--array=1-{}", count),
      fmt::format("--cpus-per-task={}", workers.threads),
      fmt::format("--time={}", workers.minutes),
      fmt::format("--signal=B:TERM@{}", workers.warning_seconds),
      "--no-requeue",  // a worker that went is replaced when there is still work
      "--output=" + workers.output};
  arguments.insert(arguments.end(), workers.extra.begin(), workers.extra.end());
  arguments.push_back("--wrap=" + script);
  return arguments;
}

void slurm_submit(const SlurmWorkers& workers, std::uint32_t count) {
  static_cast<void>(lines_of(sbatch_arguments(workers, count)));
}

void slurm_cancel(const std::vector<std::string>& ids) {
  std::vector<std::string> arguments{"scancel"};
  arguments.insert(arguments.end(), ids.begin(), ids.end());
  static_cast<void>(lines_of(arguments));
}

}  // namespace weft::cli
