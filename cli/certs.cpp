#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/print_json.h"
#include "cli/table.h"
#include "core/clock.h"
#include "core/error.h"
#include "security/authority.h"
#include "security/roles.h"
#include "security/tls_folder.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Make the certificates with which a cluster's programs know each other.\n"
    "A private authority (init) issues one certificate for each person and each machine (issue):\n"
    "a folder that --tls-folder of every weft program takes, or WEFT_TLS_FOLDER. A role says what\n"
    "its caller may do: a reader sees and fetches, a submitter also queues jobs, a worker "
    "computes,\n"
    "an admin does everything. A server's certificate names its hosts. Copy a folder to the "
    "machine\n"
    "it is for; the authority's own stays where it is. Issued anew into the same folder, a\n"
    "certificate is used without a restart.\n"
    "Example: weft certs init\n"
    "         weft certs issue hub --host hub.example\n"
    "         weft certs issue ann --role submitter\n"
    "         weft certs revoke ann";
constexpr unsigned kAuthorityDays = 3650;
constexpr unsigned kDays = 365;
constexpr unsigned kMostDays = 36500;

struct CertsOptions {
  std::string authority;
  std::string name;
  std::vector<std::string> roles;
  std::vector<std::string> hosts;
  std::string out;
  unsigned days = 0;
  bool wants_json = false;
};

// $XDG_CONFIG_HOME/weft/certs, else ~/.config/weft/certs, else in this folder.
std::filesystem::path default_folder() {
  // No other thread changes the environment: weft never does.
  const char* config = std::getenv("XDG_CONFIG_HOME");  // NOLINT(concurrency-mt-unsafe)
  if (config != nullptr && *config == '/') {
    return std::filesystem::path(config) / "weft" / "certs";
  }
  const char* home = std::getenv("HOME");  // NOLINT(concurrency-mt-unsafe)
  return home != nullptr && *home != '\0'
             ? std::filesystem::path(home) / ".config" / "weft" / "certs"
             : std::filesystem::path("weft-certs");
}

std::string joined(const std::vector<std::string>& parts) {
  return parts.empty() ? "-" : fmt::format("{}", fmt::join(parts, ", "));
}

nlohmann::json to_json(const security::Authority::Entry& entry, core::Clock::Time now) {
  std::vector<std::string> roles;
  for (const v1::Role role : entry.certificate.roles) {
    roles.push_back(security::to_string(role));
  }
  return {{"name", entry.certificate.name},
          {"serial", entry.certificate.serial},
          {"roles", roles},
          {"hosts", entry.certificate.hosts},
          {"valid_until", security::date_text(entry.certificate.valid_until)},
          {"expired", now > entry.certificate.valid_until},
          {"revoked", entry.is_revoked},
          {"folder", entry.folder.string()}};
}

void init(const CertsOptions& options) {
  const security::Authority authority = security::Authority::make(
      options.authority, options.name, std::chrono::days(options.days), core::system_clock().now());
  const std::string until = security::date_text(authority.certificate().valid_until);
  if (options.wants_json) {
    print_json(
        {{"folder", authority.folder().string()}, {"name", options.name}, {"valid_until", until}});
    return;
  }
  fmt::print("{}: authority '{}', until {}\n", authority.folder().string(), options.name, until);
  fmt::print("Whoever reads {} can make certificates of every role: keep it to yourself.\n",
             (authority.folder() / "ca.key").string());
}

void issue(const CertsOptions& options) {
  std::vector<v1::Role> roles;
  for (const std::string& role : options.roles) {
    roles.push_back(security::role_from(role));
  }
  security::Authority authority(options.authority);
  const std::filesystem::path out =
      options.out.empty() ? std::filesystem::path(options.authority).parent_path() / options.name
                          : std::filesystem::path(options.out);
  const core::Clock::Time now = core::system_clock().now();
  const security::Authority::Entry entry = authority.issue(
      options.name, roles, options.hosts, std::chrono::days(options.days), out, now);
  if (options.wants_json) {
    print_json(to_json(entry, now));
    return;
  }
  fmt::print("{}: '{}', roles {}, hosts {}, until {}\n", entry.folder.string(),
             entry.certificate.name, security::to_string(entry.certificate.roles),
             joined(entry.certificate.hosts), security::date_text(entry.certificate.valid_until));
  fmt::print("Use it with --tls-folder {}, or set WEFT_TLS_FOLDER to it.\n", entry.folder.string());
}

void revoke(const CertsOptions& options) {
  security::Authority authority(options.authority);
  const std::vector<std::filesystem::path> written =
      authority.revoke(options.name, core::system_clock().now());
  if (options.wants_json) {
    nlohmann::json files = nlohmann::json::array();
    for (const std::filesystem::path& file : written) {
      files.push_back(file.string());
    }
    print_json({{"revoked", options.name}, {"files", files}});
    return;
  }
  fmt::print("'{}' is revoked. The list was written to\n", options.name);
  for (const std::filesystem::path& file : written) {
    fmt::print("  {}\n", file.string());
  }
  fmt::print(
      "Servers take it from their folder within seconds. Copy {} into the folder of each "
      "server on another machine.\n",
      written.front().string());
}

void list(const CertsOptions& options) {
  const security::Authority authority(options.authority);
  const core::Clock::Time now = core::system_clock().now();
  const std::vector<security::Authority::Entry> entries = authority.issued();
  if (options.wants_json) {
    nlohmann::json json = nlohmann::json::array();
    for (const security::Authority::Entry& entry : entries) {
      json.push_back(to_json(entry, now));
    }
    print_json(json);
    return;
  }
  Table table({"NAME", "ROLES", "HOSTS", "UNTIL", "STATE", "SERIAL", "FOLDER"});
  for (const security::Authority::Entry& entry : entries) {
    const std::string state = entry.is_revoked                      ? "revoked"
                              : now > entry.certificate.valid_until ? "expired"
                                                                    : "good";
    table.add({entry.certificate.name, security::to_string(entry.certificate.roles),
               joined(entry.certificate.hosts), security::date_text(entry.certificate.valid_until),
               state, entry.certificate.serial, entry.folder.string()});
  }
  fmt::print("{}", table.text());
}

using Action = void (*)(const CertsOptions&);

// A command of `weft certs` with the flags that all of them have.
CLI::App* add_action(CLI::App& certs, const std::string& name, const std::string& help,
                     const std::shared_ptr<CertsOptions>& options, Action action) {
  CLI::App* command = add_command(certs, name, help);
  command->add_option("--authority", options->authority, "Folder of the authority")
      ->capture_default_str();
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options, action] { action(*options); });
  return command;
}

std::shared_ptr<CertsOptions> new_options() {
  auto options = std::make_shared<CertsOptions>();
  options->authority = (default_folder() / "authority").string();
  return options;
}

void add_days(CLI::App& command, CertsOptions& options, unsigned days) {
  options.days = days;
  command.add_option("--days", options.days, "How long it is good for")
      ->check(CLI::Range(1U, kMostDays))
      ->capture_default_str();
}

}  // namespace

void add_certs(CLI::App& app) {
  CLI::App* certs = add_command(app, "certs", kHelp);
  certs->require_subcommand(1);

  auto options = new_options();
  options->name = "weft";
  CLI::App* command = add_action(*certs, "init", "Make an authority.", options, init);
  command->add_option("--name", options->name, "What it is called")->capture_default_str();
  add_days(*command, *options, kAuthorityDays);

  options = new_options();
  command = add_action(
      *certs, "issue",
      "Issue a certificate, or a new one in place of an old one.\n"
      "Without --role and --host it is for what the name was given last. A server's certificate "
      "is\n"
      "good for localhost too; with a role as well, it is also a caller's: a render node is a\n"
      "reader at the coordinator.",
      options, issue);
  command->add_option("name", options->name, "The person, or the machine")->required();
  command->add_option("--role", options->roles, "What its caller may do; may be repeated")
      ->check(CLI::IsMember({"reader", "submitter", "worker", "admin"}));
  command->add_option("--host", options->hosts,
                      "A name or an address by which others call this server; may be repeated");
  command->add_option("-o,--output,--out", options->out,
                      "Folder to write; default: NAME beside the authority's");
  add_days(*command, *options, kDays);

  options = new_options();
  command = add_action(*certs, "revoke",
                       "Make servers refuse a certificate from now on.\n"
                       "A name stands for all its certificates up to now; one issued to it later "
                       "is good.",
                       options, revoke);
  command->add_option("name", options->name, "The name, or the serial of one certificate")
      ->required();

  add_action(*certs, "list", "Say what was issued.", new_options(), list);
}

}  // namespace weft::cli
