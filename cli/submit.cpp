#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/estimate.h"
#include "cli/follow_job.h"
#include "cli/output_file.h"
#include "cli/present.h"
#include "cli/print_json.h"
#include "cli/quality.h"
#include "client/fetch_version.h"
#include "core/error.h"
#include "fabric/description.h"
#include "proto/limits.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Queue the precomputation of a fabric with a coordinator.\n"
    "Every file that the description names is sent with it. Work that was done before, for any\n"
    "fabric, is not done again.\n"
    "With --wait, progress is shown until the job has ended; Ctrl-C ends the waiting, not the\n"
    "job, and says how to come back; a second one within three seconds cancels the job.\n"
    "Example: weft submit examples/tiny.textproto --quality preview --wait -o tiny.h5";

struct SubmitFlags {
  security::Endpoint coordinator;
  std::string fabric;
  std::string output;
  std::string quality;
  v1::SubmitOptions demands;
  bool is_waiting = false;
  bool is_dry_run = false;
  bool wants_json = false;
};

v1::Job submit(Client& client, const v1::FabricDescription& description,
               const v1::SubmitOptions& demands) {
  v1::SubmitRequest request;
  request.set_request_id(new_request_id());
  *request.mutable_description() = description;
  *request.mutable_options() = demands;
  if (request.ByteSizeLong() > v1::kMessageLimitBytes) {
    throw core::Error(core::Code::kResourceExhausted,
                      fmt::format("the description is larger than {} with the files it names; "
                                  "crop the draft, or give fewer fibres",
                                  format_bytes(v1::kMessageLimitBytes)));
  }
  return client
      .call_repeatedly(client.jobs(), &v1::JobService::Stub::Submit, request,
                       "submit " + description.name())
      .job();
}

// The job is done then; what came of its database is kept.
void throw_if_interrupted(const Interruption& interruption, const v1::Version& version,
                          const std::string& output) {
  if (interruption.requested()) {
    throw core::Error(core::Code::kCancelled,
                      fmt::format("stopped fetching; the job is done, and 'weft fetch {} -o {}' "
                                  "goes on where it was",
                                  reference_text(version), output));
  }
}

// What earlier work saved.
std::string saved_text(const v1::Job& job) {
  std::uint64_t shards = 0;
  std::uint64_t cached = 0;
  for (const v1::StageProgress& stage : job.stages()) {
    shards += stage.shards();
    cached += stage.shards_cached();
  }
  return fmt::format("{} of {} results ({}) were there, and {} of the version's {}", cached, shards,
                     format_bytes(job.cached_bytes()), format_bytes(job.version().shared_bytes()),
                     format_bytes(job.version().size_bytes()));
}

void run(const SubmitFlags& options) {
  const v1::FabricDescription description =
      fabric::load_description(options.fabric, parse_quality(options.quality));
  if (options.is_dry_run) {
    print_estimate(description, options.wants_json);
    return;
  }
  if (!options.output.empty()) {
    check_output_file(options.output);
  }
  std::optional<Interruption> interruption;
  if (options.is_waiting) {
    interruption.emplace(kFollowInterrupts);
  }
  Client connection(options.coordinator);
  v1::Job job = submit(connection, description, options.demands);
  fmt::print(stderr, "submitted {} as {}; 'weft watch {}' shows how far it is\n", job.fabric(),
             job.id(), job.id());
  if (options.is_waiting) {
    job = follow_job(connection, job.id(), *interruption);
  }
  if (job.state() == v1::JOB_STATE_SUCCEEDED && job.cached_bytes() > 0) {
    fmt::print(stderr, "{}\n", saved_text(job));
  }
  bool was_fetched = false;
  if (job.state() == v1::JOB_STATE_SUCCEEDED && !options.output.empty()) {
    client::fetch_version(connection, job.version(), options.output,
                          [&](std::uint64_t /*here*/, std::uint64_t /*total*/) {
                            throw_if_interrupted(*interruption, job.version(), options.output);
                          });
    was_fetched = true;
  }
  if (options.wants_json) {
    nlohmann::json json = to_json(job);
    json["output"] = nullptr;
    if (was_fetched) {
      json["output"] = options.output;
    }
    print_json(json);
  }
  if (options.is_waiting) {
    throw_unless_succeeded(job);
  }
  if (options.wants_json) {
    return;
  }
  if (was_fetched) {
    fmt::print("{}: {}, {}, content {}\n", options.output, reference_text(job.version()),
               format_bytes(job.version().size_bytes()),
               short_digest(job.version().content_digest()));
  } else if (options.is_waiting) {
    fmt::print("{}\n", reference_text(job.version()));
  } else {
    fmt::print("{}\n", job.id());
  }
}

void add_demands(CLI::App& command, v1::SubmitOptions& demands) {
  const auto text = [&](const std::string& name, auto set, const std::string& help) {
    return command.add_option_function<std::string>(
        name, [&demands, set](const std::string& value) { (demands.*set)(value); }, help);
  };
  text("--comment", &v1::SubmitOptions::set_comment<const std::string&>,
       "A line kept with the version (1024 bytes)")
      ->check([](const std::string& comment) {
        return comment.size() <= v1::kCommentLimitBytes ? std::string()
                                                        : "the comment is longer than 1024 bytes";
      });
  text("--user", &v1::SubmitOptions::set_user<const std::string&>,
       "Who it is for, in the cluster's shares (default: you)")
      ->envname("WEFT_USER");
  command
      .add_option_function<std::int32_t>(
          "--priority", [&demands](std::int32_t value) { demands.set_priority(value); },
          "From -100 to 100, the higher the earlier (default: 0)")
      ->check(CLI::Range(-100, 100));
  command
      .add_option_function<double>(
          "--audit", [&demands](double value) { demands.set_audit(value); },
          "Share of the work that a second worker repeats and compares, 0 to 1 (default: 0)")
      ->check(CLI::Range(0.0, 1.0));
  command
      .add_option_function<std::vector<std::string>>(
          "--label",
          [&demands](const std::vector<std::string>& labels) {
            demands.mutable_labels()->Assign(labels.begin(), labels.end());
          },
          "Only workers with this label (as often as needed)")
      ->allow_extra_args(false);
}

}  // namespace

void add_submit(CLI::App& app) {
  auto options = std::make_shared<SubmitFlags>();
  CLI::App* command = add_command(app, "submit", kHelp);
  command->add_option("fabric", options->fabric, "Description: a .textproto or .json file")
      ->required();
  add_quality_option(*command, options->quality);
  add_demands(*command, options->demands);
  CLI::Option* wait =
      command->add_flag("--wait", options->is_waiting, "Return when the job has ended");
  command
      ->add_option("-o,--output", options->output,
                   "Fetch the database into this file when it is done (needs --wait)")
      ->needs(wait);
  command
      ->add_flag("--dry-run", options->is_dry_run,
                 "Only print what the fabric will need: fibres, segments, memory, disk, time")
      ->excludes(wait);
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
