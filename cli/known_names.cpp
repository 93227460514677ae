#include "cli/known_names.h"

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cli/client.h"
#include "cli/present.h"
#include "core/settings.h"
#include "proto/address.h"

namespace weft::cli {

namespace {

using core::Completion;
using core::CompletionPlace;
using core::Completions;

constexpr std::int64_t kPatienceMs = 400;
constexpr std::int64_t kLongestPatienceMs = 60'000;
constexpr std::uint32_t kJobsListed = 50;

// The last value of an option among words as they were typed; empty when it is not there.
std::string typed_value(const std::vector<std::string>& words, const std::string& option) {
  std::string value;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == option && i + 1 < words.size()) {
      value = words[i + 1];
    } else if (words[i].starts_with(option + "=")) {
      value = words[i].substr(option.size() + 1);
    }
  }
  return value;
}

security::Endpoint coordinator_of(const CompletionPlace& place) {
  const core::Settings settings = core::Settings::load();
  const auto value = [&](const std::string& key, const std::string& variable) {
    const std::string typed = typed_value(place.words_before, "--" + key);
    if (!typed.empty()) {
      return typed;
    }
    const auto found = settings.find(place.command, key, variable);
    return found && !found->values.empty() ? found->values.front() : std::string();
  };
  security::Endpoint endpoint(value("coordinator", "WEFT_COORDINATOR"),
                              value("tls-folder", "WEFT_TLS_FOLDER"),
                              value("insecure", "") == "true");
  if (endpoint.address.empty()) {
    endpoint.address = kDefaultCoordinator;
  }
  for (const std::string& word : place.words_before) {
    endpoint.insecure = endpoint.insecure || word == "--insecure";
  }
  return endpoint;
}

// WEFT_COMPLETION_MS for those whose coordinator is far away.
std::int64_t patience_ms() {
  // No other thread changes the environment: weft does so before it starts the first.
  const char* value = std::getenv("WEFT_COMPLETION_MS");  // NOLINT(concurrency-mt-unsafe)
  const std::int64_t wanted = value == nullptr ? 0 : std::strtoll(value, nullptr, 10);
  return wanted > 0 ? std::min(wanted, kLongestPatienceMs) : kPatienceMs;
}

// One call that is not waited for longer than a person who pressed a key.
template <class Stub, class Request, class Response>
Response ask(Stub& stub,
             grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
             const Request& request) {
  grpc::ClientContext context;
  context.set_deadline(gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC),
                                    gpr_time_from_millis(patience_ms(), GPR_TIMESPAN)));
  Response response;
  return (stub.*method)(&context, request, &response).ok() ? response : Response();
}

Completions jobs(Client& client) {
  v1::ListJobsRequest request;
  request.set_limit(kJobsListed);
  Completions found;
  const auto response = ask(client.jobs(), &v1::JobService::Stub::ListJobs, request);
  for (const v1::Job& job : response.jobs()) {
    found.words.push_back({job.id(), job.fabric() + ", " + state_text(job.state())});
  }
  return found;
}

Completions workers(Client& client) {
  Completions found;
  const auto response =
      ask(client.workers(), &v1::WorkersService::Stub::ListWorkers, v1::ListWorkersRequest());
  for (const v1::Worker& worker : response.workers()) {
    found.words.push_back({worker.name(), condition_text(worker)});
  }
  return found;
}

Completions fabrics(Client& client) {
  Completions found;
  const auto response =
      ask(client.catalogue(), &v1::CatalogueService::Stub::ListFabrics, v1::ListFabricsRequest());
  for (const auto& fabric : response.fabrics()) {
    found.words.push_back({fabric.name(), "published fabric"});
  }
  return found;
}

// Names of fabrics, and of the versions of the one that was typed already.
Completions versions(Client& client, const std::string& beginning) {
  const std::size_t end = beginning.find_first_of("@:");
  if (end == std::string::npos) {
    return fabrics(client);
  }
  v1::ListVersionsRequest request;
  request.set_fabric(beginning.substr(0, end));
  Completions found;
  const auto response = ask(client.catalogue(), &v1::CatalogueService::Stub::ListVersions, request);
  for (const v1::Version& version : response.versions()) {
    found.words.push_back({reference_text(version), version.comment()});
    for (const std::string& tag : version.tags()) {
      found.words.push_back({version.fabric() + ":" + tag, reference_text(version)});
    }
  }
  return found;
}

// What is neither asked for nor a file.
bool is_free_text(const std::string& argument) {
  static const std::set<std::string> names{
      "NAME",         "TAG",      "--name",  "--comment", "--user",   "--label",
      "--size",       "--layers", "--layer", "--host",    "--listen", "--coordinator",
      "--node",       "--task",   "--stage", "--preset",  "--tiles",  "--crop-ends",
      "--crop-picks", "--grace",  "--keep",  "--device",  "--orders"};
  return names.contains(argument);
}

bool names_a_version(const std::string& argument) {
  return argument == "REFERENCE" || argument == "VERSION" || argument == "FROM" || argument == "TO";
}

std::optional<Completions> names_for(const CLI::App& app, const CompletionPlace& place) {
  const std::string& argument = place.argument;
  if (place.command == "man") {
    Completions commands;
    for (const CLI::App* command : app.get_subcommands({})) {
      commands.words.push_back({command->get_name(), command->get_description()});
    }
    return commands;
  }
  if (is_free_text(argument)) {
    return Completions();
  }
  const bool is_kind_of = place.command == "explain" && argument == "SUBJECT";
  const bool is_worker = argument == "WORKER" || (is_kind_of && !place.words_before.empty() &&
                                                  place.words_before.back() == "worker");
  const bool is_job = argument == "JOB" || (is_kind_of && !is_worker);
  const bool is_of_a_name =
      argument == "FABRIC" && (place.command == "versions" || place.command == "log");
  const bool is_either = argument == "FABRIC" && place.command == "render";
  // `weft compare` and others have a REFERENCE that is a file.
  const bool is_version = names_a_version(argument) && place.command != "compare";
  if (!is_worker && !is_job && !is_of_a_name && !is_either && !is_version) {
    return std::nullopt;
  }
  Client client(coordinator_of(place));
  Completions found = is_worker      ? workers(client)
                      : is_job       ? jobs(client)
                      : is_of_a_name ? fabrics(client)
                                     : versions(client, place.beginning);
  found.takes_files = is_either;
  return found;
}

}  // namespace

core::CompletionSource known_names(const CLI::App& app) {
  return [&app](const CompletionPlace& place) -> std::optional<Completions> {
    try {
      return names_for(app, place);
    } catch (const std::exception&) {
      return std::nullopt;  // a mistake in the configuration, too, is said elsewhere
    }
  };
}

}  // namespace weft::cli
