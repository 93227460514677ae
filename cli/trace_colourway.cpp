#include "cli/trace_colourway.h"

#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cli/client.h"
#include "cli/colour_text.h"
#include "cli/colourway_source.h"
#include "cli/fabric_reference.h"
#include "cli/follow_job.h"
#include "cli/local_run.h"
#include "cli/present.h"
#include "client/fetch_version.h"
#include "core/check.h"
#include "core/error.h"
#include "core/interrupt.h"

namespace weft::cli {

namespace {

v1::Job submit(const v1::FabricDescription& description, const std::string& comment,
               Client& connection) {
  Interruption interruption(kFollowInterrupts);
  v1::SubmitRequest request;
  request.set_request_id(new_request_id());
  *request.mutable_description() = description;
  request.mutable_options()->set_comment(comment);
  v1::Job job = connection
                    .call_repeatedly(connection.jobs(), &v1::JobService::Stub::Submit, request,
                                     "submit " + description.name())
                    .job();
  fmt::print(stderr, "submitted {} as {}; 'weft watch {}' shows how far it is\n", job.fabric(),
             job.id(), job.id());
  job = follow_job(connection, job.id(), interruption);
  throw_unless_succeeded(job);
  return job;
}

void roll_back(const std::string& reference, const std::string& comment,
               const TraceOptions& options) {
  Client connection(options.coordinator);
  v1::RollBackRequest request;
  request.set_request_id(new_request_id());
  request.set_reference(reference);
  request.set_comment(comment);
  (void)connection.call_repeatedly(connection.catalogue(), &v1::CatalogueService::Stub::RollBack,
                                   request, "make " + reference + " the latest");
}

// Traces the description: by the coordinator where the source is published, else here, with every
// shard kept until the end. Leaves the database at options.output, if that names a file, and
// returns its name.
std::filesystem::path trace(const TraceOptions& options, const ColourwayModel& model,
                            const ColourwayRequest& request,
                            const v1::FabricDescription& description, Recolored& made) {
  if (request.source->is_published) {
    Client connection(options.coordinator);
    const v1::Job job = submit(description, options.comment, connection);
    made.version = client::reference_text(job.version());
    made.digest = client::version_digest(job.version()).hex();
    if (!options.output.empty()) {
      client::fetch_version(connection, job.version(), options.output, nullptr);
      return options.output;
    }
    return {};
  }
  const bool is_own_cache = options.cache.empty();
  const std::filesystem::path folder = is_own_cache ? options.output + ".weft" : options.cache;
  core::Interrupt interrupt;
  std::optional<FolderLock> lock;
  if (is_own_cache) {
    lock.emplace(folder);
  }
  ResultCache cache(folder);
  ProgressPrinter printer(stderr);
  const LocalRunHooks hooks{
      [&](const std::vector<StageProgress>& stages) { printer.update(stages); },
      [&] { return interrupt.requested(); }};
  const LocalRunResult result =
      run_locally(description, model.threads, cache, options.output, hooks);
  printer.finish(result.stages);
  made.digest = result.content_digest.hex();
  return options.output;
}

void remove_own_cache(const TraceOptions& options) {
  if (options.cache.empty()) {
    std::error_code ignored;  // a folder left over does no harm
    std::filesystem::remove_all(options.output + ".weft", ignored);
  }
}

// What the fabric's name meant before; empty where it was no fabric's.
std::string latest_of(const std::string& fabric, const TraceOptions& options) {
  Client connection(options.coordinator);
  try {
    return client::reference_text(client::find_version(connection, fabric));
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kNotFound) {
      throw;
    }
    return {};
  }
}

// The traced colourway is `best`, though others were traced after it.
void go_back_to(const Recolored& best, const TraceOptions& options, const ColourwayModel& model,
                const ColourwayRequest& request) {
  if (request.source->is_published) {
    roll_back(best.version, "nearer to the colours that were asked for", options);
  } else {
    Recolored again;  // what it is made from is in the cache
    (void)trace(options, model, request, recolored_description(request, best.fit), again);
  }
}

// Leaves things as they were, as far as can be, and says what is there.
[[noreturn]] void give_up(const Recolored& best, const std::string& latest,
                          const TraceOptions& options, const ColourwayRequest& request) {
  std::string what;
  if (!request.source->is_published) {
    std::error_code ignored;  // a file left over says what it is
    std::filesystem::remove(options.output, ignored);
    remove_own_cache(options);
  } else if (latest.empty()) {
    what = "; " + best.version + " has that";
  } else {
    roll_back(latest, "what was traced since is not what was asked for", options);
    what = "; " + best.version + " has that, and " + latest + " is the latest again";
  }
  for (std::size_t t = 0; t < request.targets.size(); ++t) {
    if (best.fit.delta_e[t] >= kPromisedDeltaE) {
      throw core::Error(
          core::Code::kInvalidArgument,
          fmt::format("traced, yarn {} shows {} where {} was asked for, Delta E 2000 {:.1f}, and "
                      "other dyes did not bring it nearer{}; take it with --nearest, or make the "
                      "fabric with more paths_per_cell",
                      request.targets[t].label, hex_text(best.fit.reached[t]),
                      hex_text(request.targets[t].linear), best.fit.delta_e[t], what));
    }
  }
  core::check_failed(__FILE__, __LINE__, "the colours were met");
}

}  // namespace

Recolored trace_colourway(const TraceOptions& options, const ColourwayModel& model,
                          const ColourwayRequest& request) {
  constexpr int kMostRounds = 3;
  const bool will_publish = request.source->is_published && !options.is_dry_run;
  const std::string latest = will_publish ? latest_of(request.name, options) : "";
  Recolored best;
  Recolored made;
  ColourwayRequest wanted = request;
  ColourRatios bias(request.targets.size(), glm::dvec3(1));
  for (int round = 0; round < kMostRounds; ++round) {
    std::vector<shading::FibreMaterial> last = std::move(made.fit.materials);
    made = {};
    made.is_exact = true;
    made.fit = carry_colourway(model, wanted, bias).fit;
    if (options.is_dry_run) {
      return made;
    }
    if (made.fit.materials == last) {
      break;  // as near as the dyes get
    }
    made.output = options.output;
    const std::filesystem::path path =
        trace(options, model, request, recolored_description(request, made.fit), made);
    measure_fit(model, request,
                storage::read_database(
                    path.empty() ? resolve_fabric(made.version, options.coordinator) : path),
                ColourRatios(request.targets.size(), glm::dvec3(1)), made.fit, bias);
    if (best.digest.empty() || made.fit.worst_delta_e() < best.fit.worst_delta_e()) {
      best = made;
    }
    if (best.fit.worst_delta_e() < kPromisedDeltaE) {
      break;
    }
    wanted.takes_nearest = true;  // what tracing shows decides
    fmt::print(stderr, "traced, the colours are Delta E 2000 {:.2f} off\n",
               made.fit.worst_delta_e());
  }
  if (best.fit.worst_delta_e() >= kPromisedDeltaE && !options.takes_nearest) {
    give_up(best, latest, options, request);
  }
  if (made.fit.materials != best.fit.materials) {
    go_back_to(best, options, model, request);
  }
  if (!request.source->is_published) {
    remove_own_cache(options);
  }
  return best;
}

}  // namespace weft::cli
