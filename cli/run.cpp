#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/estimate.h"
#include "cli/local_run.h"
#include "cli/output_file.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "cli/quality.h"
#include "cli/result_cache.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/resource_use.h"
#include "fabric/description.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Precompute a fabric in this process into one database.\n"
    "The same planner, kernels and merge as the cluster's, hence the same bytes. What is finished\n"
    "is kept in a folder beside the output (OUT.h5.weft), so a run that was stopped goes on where\n"
    "it was; the folder is removed when the database is written.\n"
    "Example: weft run examples/tiny.textproto -o tiny.h5 --quality preview";

struct RunOptions {
  std::string fabric;
  std::string output;
  std::string quality;
  std::string cache;
  unsigned threads = 0;
  bool is_dry_run = false;
  bool wants_json = false;
};

nlohmann::json to_json(const StageProgress& stage) {
  return {{"name", stage.name},
          {"shards", stage.total},
          {"cached", stage.cached},
          {"seconds", stage.seconds},
          {"cpu_seconds", stage.cpu_seconds}};
}

void print_result(const RunOptions& options, const v1::FabricDescription& description,
                  const LocalRunResult& result, double seconds) {
  const std::uint64_t size_bytes = std::filesystem::file_size(options.output);
  if (!options.wants_json) {
    fmt::print("{}: {}, content {}, made in {}\n", options.output, format_bytes(size_bytes),
               result.content_digest.hex().substr(0, 12), format_duration(seconds));
    return;
  }
  nlohmann::json stages = nlohmann::json::array();
  for (const StageProgress& stage : result.stages) {
    stages.push_back(to_json(stage));
  }
  const nlohmann::json json{{"fabric", description.name()},
                            {"output", options.output},
                            {"content_digest", result.content_digest.hex()},
                            {"size_bytes", size_bytes},
                            {"seconds", seconds},
                            {"merge_seconds", result.merge_seconds},
                            {"idle_thread_seconds", result.idle_seconds},
                            {"cpu_seconds", core::process_cpu_seconds()},
                            {"peak_memory_bytes", core::process_peak_bytes()},
                            {"stages", stages}};
  print_json(json);
}

void run(const RunOptions& options) {
  const v1::FabricDescription description =
      fabric::load_description(options.fabric, parse_quality(options.quality));
  if (options.is_dry_run) {
    print_estimate(description, options.wants_json);
    return;
  }
  if (options.output.empty()) {
    throw CLI::RequiredError("--output");
  }
  check_output_file(options.output);
  const bool is_own_cache = options.cache.empty();
  const std::filesystem::path cache_folder = is_own_cache
                                                 ? std::filesystem::path(options.output + ".weft")
                                                 : std::filesystem::path(options.cache);
  core::Interrupt interrupt;
  std::optional<FolderLock> lock;
  if (is_own_cache) {
    lock.emplace(cache_folder);
  }
  ResultCache cache(cache_folder);
  ProgressPrinter printer(stderr);
  const core::Stopwatch since_start;
  const LocalRunHooks hooks{
      [&](const std::vector<StageProgress>& stages) { printer.update(stages); },
      [&] { return interrupt.requested(); }};
  const unsigned threads =
      options.threads > 0 ? options.threads : std::max(1U, std::thread::hardware_concurrency());
  try {
    const LocalRunResult result = run_locally(description, threads, cache, options.output, hooks);
    printer.finish(result.stages);
    print_result(options, description, result, since_start.seconds());
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kCancelled) {
      throw;
    }
    throw core::Error(core::Code::kCancelled, "stopped; what is finished is kept in " +
                                                  cache_folder.string() +
                                                  ": run the same command again to go on");
  }
  if (is_own_cache) {
    std::error_code ignored;  // the database is written; a folder left over does no harm
    std::filesystem::remove_all(cache_folder, ignored);
  }
}

}  // namespace

void add_run(CLI::App& app) {
  auto options = std::make_shared<RunOptions>();
  CLI::App* command = add_command(app, "run", kHelp);
  command->add_option("fabric", options->fabric, "Description: a .textproto or .json file")
      ->required();
  command->add_option("-o,--output", options->output,
                      "Database to write (.h5); not needed with --dry-run");
  add_quality_option(*command, options->quality);
  command->add_option("--threads", options->threads, "Threads to compute on; default: all cores")
      ->check(CLI::Range(1U, 1024U));
  command->add_option("--cache", options->cache,
                      "Folder for finished work, shared between runs and kept afterwards; "
                      "default: OUTPUT.weft, removed afterwards");
  command->add_flag("--dry-run", options->is_dry_run,
                    "Only print what the fabric will need: fibres, segments, memory, disk");
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
