#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace weft::cli {

// How workers are started on a Slurm cluster.
struct SlurmWorkers {
  std::string job_name;              // by which they are found again
  std::vector<std::string> command;  // of one worker
  std::string name_prefix;  // of workers' names, before the numbers of array and task; may be empty
  std::uint32_t threads = 1;          // cpus of each
  std::uint32_t minutes = 1;          // wall time of each
  std::uint32_t warning_seconds = 1;  // SIGTERM comes so long before it is over
  std::string output;                 // file name pattern of sbatch for what they print
  std::vector<std::string> extra;     // further arguments of sbatch
};

// What of it Slurm knows now; ids as scancel takes them.
struct SlurmQueue {
  std::vector<std::string> waiting;
  std::vector<std::string> running;

  [[nodiscard]] std::size_t size() const { return waiting.size() + running.size(); }
};

// All three throw core::Error: kUnavailable when Slurm cannot be asked (its own words stand in the
// message), kFailedPrecondition when its commands are not installed. Workers are of this user.
[[nodiscard]] SlurmQueue slurm_queue(const std::string& job_name);
// Submits `count` workers as one job array.
void slurm_submit(const SlurmWorkers& workers, std::uint32_t count);
void slurm_cancel(const std::vector<std::string>& ids);

// What sbatch is called with, for slurm_submit and its test.
[[nodiscard]] std::vector<std::string> sbatch_arguments(const SlurmWorkers& workers,
                                                        std::uint32_t count);

}  // namespace weft::cli
