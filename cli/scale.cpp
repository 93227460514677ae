#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/child_process.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/slurm.h"
#include "cli/wanted_workers.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "proto/limits.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Start as many workers elsewhere as the queue can keep busy.\n"
    "Example: weft scale slurm --max-workers 20 --threads 8";

constexpr const char* kSlurmHelp =
    "Start workers as Slurm jobs, more or fewer as the queue grows and shrinks.\n"
    "Runs until Ctrl-C, on a machine from which jobs are submitted. Workers take nothing that "
    "their "
    "time\n"
    "limit would cut off, finish what they have when Slurm ends them, and leave when they are "
    "idle;\n"
    "those that still wait in Slurm's queue are cancelled when they are no longer wanted, and "
    "when\n"
    "this command ends. The coordinator's address must be one that the nodes reach, which wants\n"
    "certificates (docs/security.md).\n"
    "Exits with 1 where sbatch or squeue are missing, 5 when the coordinator or Slurm do not "
    "answer\n"
    "at the start; later it tries again.\n"
    "Example: weft scale slurm --max-workers 20 --threads 8 --sbatch=--partition=render";

struct ScaleOptions {
  security::Endpoint coordinator;
  std::string coordinator_of_workers;
  std::string worker;
  ScaleLimits limits;
  SlurmWorkers slurm;
  std::uint32_t idle_seconds = 60;
  double look_seconds = 10;
  bool looks_once = false;
};

// The limits of a worker's last seconds: Slurm's signal comes with the first, and the worker counts
// on being done by then.
constexpr std::uint32_t kWarningSeconds = 30;

std::vector<std::string> command_of_worker(const ScaleOptions& options) {
  const std::string& at = options.coordinator_of_workers.empty() ? options.coordinator.address
                                                                 : options.coordinator_of_workers;
  std::vector<std::string> command{options.worker,
                                   "--coordinator",
                                   at,
                                   "--threads",
                                   std::to_string(options.limits.threads),
                                   "--exit-when-idle",
                                   std::to_string(options.idle_seconds),
                                   "--wall-limit",
                                   std::to_string(options.slurm.minutes * 60 - kWarningSeconds)};
  if (!options.coordinator.tls_folder.empty()) {
    command.insert(command.end(), {"--tls-folder", options.coordinator.tls_folder});
  }
  if (options.coordinator.insecure) {
    command.emplace_back("--insecure");
  }
  return command;
}

// Looks at the coordinator and at Slurm once, and acts.
void look(Client& client, const ScaleOptions& options) {
  v1::ListJobsRequest request;
  request.set_unfinished_only(true);
  const auto jobs =
      client.call(client.jobs(), &v1::JobService::Stub::ListJobs, request, "list the jobs");
  const auto workers = client.call(client.workers(), &v1::WorkersService::Stub::ListWorkers,
                                   v1::ListWorkersRequest(), "list the workers");
  const SlurmQueue queue = slurm_queue(options.slurm.job_name);
  const auto now = static_cast<std::uint32_t>(queue.size());
  const std::vector<v1::Job> unfinished(jobs.jobs().begin(), jobs.jobs().end());
  const std::vector<v1::Worker> known(workers.workers().begin(), workers.workers().end());
  const std::uint32_t wanted = wanted_workers(unfinished, known, now, options.limits);
  if (wanted > now) {
    slurm_submit(options.slurm, wanted - now);
    fmt::print("{} running, {} waiting: {} more submitted\n", queue.running.size(),
               queue.waiting.size(), wanted - now);
  } else if (wanted < now && !queue.waiting.empty()) {
    const std::size_t excess = std::min<std::size_t>(now - wanted, queue.waiting.size());
    slurm_cancel({queue.waiting.end() - static_cast<std::ptrdiff_t>(excess), queue.waiting.end()});
    fmt::print("{} running, {} waiting: {} of those cancelled\n", queue.running.size(),
               queue.waiting.size(), excess);
  }
  std::fflush(stdout);
}

void wait(double seconds, core::Interrupt& interrupt) {
  const core::Stopwatch since;
  while (!interrupt.requested() && since.seconds() < seconds) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

void cancel_waiting(const SlurmWorkers& workers) {
  const SlurmQueue queue = slurm_queue(workers.job_name);
  if (!queue.waiting.empty()) {
    slurm_cancel(queue.waiting);
  }
  fmt::print("{} waiting workers cancelled, {} go on until they are idle\n", queue.waiting.size(),
             queue.running.size());
}

void run(ScaleOptions options) {
  if (options.limits.fewest > options.limits.most) {
    throw CLI::ValidationError("--min-workers", "it is above --max-workers");
  }
  if (options.worker.empty()) {
    options.worker = (program_folder() / "weft-worker").string();
  }
  options.slurm.threads = options.limits.threads;
  options.slurm.warning_seconds = kWarningSeconds;
  options.slurm.command = command_of_worker(options);
  core::Interrupt interrupt;
  Client client(options.coordinator);
  look(client, options);
  if (options.looks_once) {
    return;
  }
  for (wait(options.look_seconds, interrupt); !interrupt.requested();
       wait(options.look_seconds, interrupt)) {
    try {
      look(client, options);
    } catch (const core::Error& error) {
      if (error.code() != core::Code::kUnavailable) {
        throw;
      }
      fmt::print(stderr, "weft: {}; looking again in {} s\n", error.what(), options.look_seconds);
    }
  }
  cancel_waiting(options.slurm);
}

void add_slurm(CLI::App& scale) {
  auto options = std::make_shared<ScaleOptions>();
  CLI::App* command = add_command(scale, "slurm", kSlurmHelp);
  command->add_option("--max-workers", options->limits.most, "How many workers at most")
      ->required()
      ->check(CLI::Range(1U, v1::kListLimit));
  command
      ->add_option("--min-workers", options->limits.fewest,
                   "How many workers also when there is nothing to do; they are replaced when "
                   "they leave")
      ->check(CLI::Range(0U, v1::kListLimit))
      ->capture_default_str();
  command->add_option("--threads", options->limits.threads, "Threads, and CPUs, of each worker")
      ->check(CLI::Range(1U, 4096U))
      ->capture_default_str();
  options->slurm.minutes = 240;
  command->add_option("--minutes", options->slurm.minutes, "Wall time of each worker, in minutes")
      ->check(CLI::Range(2U, 100'000U))
      ->capture_default_str();
  command
      ->add_option("--idle-seconds", options->idle_seconds, "How long a worker without work stays")
      ->check(CLI::Range(1U, 100'000U))
      ->capture_default_str();
  command
      ->add_option("--seconds-of-work", options->limits.seconds_of_work,
                   "For how much work of one thread another one is started")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  command->add_option("--look-seconds", options->look_seconds, "How often the queue is looked at")
      ->check(CLI::Range(0.5, 3600.0))
      ->capture_default_str();
  command->add_flag("--once", options->looks_once, "Look once, act, and end, as for cron");
  options->slurm.job_name = "weft-worker";
  command
      ->add_option("--job-name", options->slurm.job_name,
                   "Name of the Slurm jobs; another one for each coordinator")
      ->capture_default_str();
  options->slurm.name_prefix = "slurm";
  command
      ->add_option("--name-prefix", options->slurm.name_prefix,
                   "What workers' names begin with: with --tls-folder, their certificate's name")
      ->capture_default_str();
  command->add_option("--worker", options->worker,
                      "Path of weft-worker on the nodes; default: beside this program");
  command->add_option("--workers-coordinator", options->coordinator_of_workers,
                      "Address of the coordinator as the nodes reach it; default: --coordinator");
  options->slurm.output = "/dev/null";
  command
      ->add_option("--output", options->slurm.output,
                   "Where workers' own messages go, as sbatch --output takes it; what attempts "
                   "log the coordinator keeps")
      ->capture_default_str();
  command->add_option(
      "--sbatch", options->slurm.extra,
      "A further argument of sbatch, as --sbatch=--partition=render; may be repeated");
  add_coordinator_option(*command, options->coordinator);
  command->callback([options] { run(*options); });
}

}  // namespace

void add_scale(CLI::App& app) {
  CLI::App* command = add_command(app, "scale", kHelp);
  command->require_subcommand(1);
  add_slurm(*command);
}

}  // namespace weft::cli
