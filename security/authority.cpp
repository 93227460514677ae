#include "security/authority.h"

#include <algorithm>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/file.h>
#include <unistd.h>

#include "core/error.h"
#include "core/file.h"
#include "proto/names.h"
#include "security/private_file.h"
#include "security/roles.h"
#include "security/tls_folder.h"

namespace weft::security {

namespace {

// A machine whose clock is behind must not find a new certificate to be of the future.
constexpr auto kClocksDiffer = std::chrono::minutes(10);
// Those that a server can always be called by, on its own machine.
const char* const kOwnHosts[] = {"localhost", "127.0.0.1", "::1"};

// Held while the folder is changed.
class Lock {
 public:
  explicit Lock(const std::filesystem::path& folder)
      : file_(open((folder / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, S_IRUSR | S_IWUSR)) {
    if (file_ < 0 || flock(file_, LOCK_EX) != 0) {
      throw core::Error(core::Code::kUnavailable,
                        "cannot write to " + folder.string() + "; is it yours?");
    }
  }
  ~Lock() { close(file_); }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;
  Lock(Lock&&) = delete;
  Lock& operator=(Lock&&) = delete;

 private:
  int file_;
};

std::int64_t ms(core::Clock::Time time) { return time.time_since_epoch().count(); }
core::Clock::Time time_from(std::int64_t milliseconds) {
  return core::Clock::Time(std::chrono::milliseconds(milliseconds));
}

nlohmann::json to_json(const Authority::Entry& entry) {
  std::vector<std::string> roles;
  for (const v1::Role role : entry.certificate.roles) {
    roles.push_back(to_string(role));
  }
  nlohmann::json json = {{"name", entry.certificate.name},
                         {"serial", entry.certificate.serial},
                         {"roles", roles},
                         {"hosts", entry.certificate.hosts},
                         {"valid_from_ms", ms(entry.certificate.valid_from)},
                         {"valid_until_ms", ms(entry.certificate.valid_until)},
                         {"folder", entry.folder.string()}};
  if (entry.is_revoked) {
    json["revoked_at_ms"] = ms(entry.revoked_at);
  }
  return json;
}

Authority::Entry entry_from(const nlohmann::json& json, const std::string& issuer) {
  Authority::Entry entry;
  entry.certificate.name = json.at("name");
  entry.certificate.serial = json.at("serial");
  for (const std::string role : json.at("roles")) {
    entry.certificate.roles.push_back(role_from(role));
  }
  entry.certificate.hosts = json.at("hosts").get<std::vector<std::string>>();
  entry.certificate.issuer = issuer;
  entry.certificate.valid_from = time_from(json.at("valid_from_ms"));
  entry.certificate.valid_until = time_from(json.at("valid_until_ms"));
  entry.folder = json.at("folder").get<std::string>();
  entry.is_revoked = json.contains("revoked_at_ms");
  entry.revoked_at = time_from(json.value("revoked_at_ms", std::int64_t{0}));
  return entry;
}

void check_name(const std::string& name) {
  if (!v1::is_user_name(name)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "'" + name +
                          "' is not a name; it has 1 to 64 letters, digits, '_', '.', '@' and "
                          "'-', and begins with a letter or a digit");
  }
}

// Takes roles and hosts from the last certificate of the name where none are given.
void complete(const std::vector<Authority::Entry>& entries, Request& request) {
  if (!request.roles.empty() || !request.hosts.empty()) {
    return;
  }
  const auto last = std::find_if(entries.rbegin(), entries.rend(), [&](const auto& entry) {
    return entry.certificate.name == request.name;
  });
  if (last == entries.rend()) {
    throw core::Error(core::Code::kInvalidArgument,
                      "'" + request.name +
                          "' has no certificate yet; say what the new one is for: --role reader, "
                          "submitter, worker or admin for those who call, --host NAME for servers");
  }
  request.roles = last->certificate.roles;
  request.hosts = last->certificate.hosts;
}

// Replacing one's own certificate is how certificates are rotated; another's would be lost.
void check_out(const TlsFolder& out, const std::string& name) {
  std::error_code failure;
  if (!std::filesystem::exists(out.certificate(), failure)) {
    return;
  }
  const Certificate there = read_certificate(core::read_file(out.certificate()));
  if (there.name != name) {
    throw core::Error(core::Code::kInvalidArgument, out.path.string() +
                                                        " holds the certificate of '" + there.name +
                                                        "'; name another folder with --output");
  }
}

}  // namespace

Authority Authority::make(const std::filesystem::path& folder, const std::string& name,
                          std::chrono::days life, core::Clock::Time now) {
  check_name(name);
  make_private_folder(folder);
  const Lock lock(folder);
  std::error_code failure;
  if (std::filesystem::exists(folder / "ca.key", failure)) {
    throw core::Error(core::Code::kAlreadyExists,
                      folder.string() +
                          " has an authority already; with a new one all certificates would have "
                          "to be issued anew. Name another folder with --authority");
  }
  const KeyPair pair = make_authority({name, {}, {}, now - kClocksDiffer, now + life});
  write_private_file(folder / "ca.key", pair.key);
  core::write_file_atomically(folder / "ca.pem", pair.certificate);
  Authority authority(folder);
  authority.save({});
  authority.write_list({}, now);
  return authority;
}

Authority::Authority(std::filesystem::path folder) : folder_(std::move(folder)) {
  std::error_code failure;
  if (!std::filesystem::exists(folder_ / "ca.pem", failure)) {
    throw core::Error(core::Code::kNotFound, "there is no authority in " + folder_.string() +
                                                 "; make one with 'weft certs init', or name its "
                                                 "folder with --authority");
  }
}

Certificate Authority::certificate() const {
  return read_certificate(core::read_file(folder_ / "ca.pem"));
}

KeyPair Authority::key_pair() const {
  return {core::read_file(folder_ / "ca.pem"), core::read_file(folder_ / "ca.key")};
}

Authority::Entry Authority::issue(const std::string& name, std::vector<v1::Role> roles,
                                  std::vector<std::string> hosts, std::chrono::days life,
                                  const std::filesystem::path& out, core::Clock::Time now) {
  check_name(name);
  const Lock lock(folder_);
  std::vector<Entry> entries = issued();
  Request request{name, std::move(roles), std::move(hosts), now - kClocksDiffer, now + life};
  complete(entries, request);
  for (const char* host : kOwnHosts) {
    if (!request.hosts.empty() &&
        std::find(request.hosts.begin(), request.hosts.end(), host) == request.hosts.end()) {
      request.hosts.emplace_back(host);
    }
  }
  request.valid_until = std::min(request.valid_until, certificate().valid_until);
  const TlsFolder folder{std::filesystem::absolute(out)};
  check_out(folder, name);
  const KeyPair issued = security::issue(key_pair(), request);
  entries.push_back({read_certificate(issued.certificate), folder.path, false, {}});
  entries.back().certificate.hosts = request.hosts;  // as they were written
  // Before the certificate can be used anywhere, it is known here and can be revoked.
  save(entries);
  make_private_folder(folder.path);
  core::write_file_atomically(folder.authority(), core::read_file(folder_ / "ca.pem"));
  if (!request.hosts.empty()) {
    core::write_file_atomically(folder.revoked(), core::read_file(folder_ / "revoked.pem"));
  }
  write_private_file(folder.key(), issued.key);
  core::write_file_atomically(folder.certificate(), issued.certificate);
  return entries.back();
}

std::vector<std::filesystem::path> Authority::revoke(const std::string& name_or_serial,
                                                     core::Clock::Time now) {
  const Lock lock(folder_);
  std::vector<Entry> entries = issued();
  bool is_known = false;
  for (Entry& entry : entries) {
    if ((entry.certificate.name == name_or_serial || entry.certificate.serial == name_or_serial)) {
      is_known = true;
      entry.revoked_at = entry.is_revoked ? entry.revoked_at : now;
      entry.is_revoked = true;
    }
  }
  if (!is_known) {
    throw core::Error(core::Code::kNotFound, "no certificate of the name or serial '" +
                                                 name_or_serial +
                                                 "' was issued here; 'weft certs list' lists them");
  }
  save(entries);
  write_list(entries, now);
  const std::string list = core::read_file(folder_ / "revoked.pem");
  const std::string authority = core::read_file(folder_ / "ca.pem");
  std::vector<std::filesystem::path> written{folder_ / "revoked.pem"};
  for (const Entry& entry : entries) {
    const TlsFolder folder{entry.folder};
    std::error_code failure;
    if (!entry.certificate.hosts.empty() &&
        std::find(written.begin(), written.end(), folder.revoked()) == written.end() &&
        std::filesystem::exists(folder.authority(), failure) &&
        core::read_file(folder.authority()) == authority) {
      core::write_file_atomically(folder.revoked(), list);
      written.push_back(folder.revoked());
    }
  }
  return written;
}

std::vector<Authority::Entry> Authority::issued() const {
  std::vector<Entry> entries;
  const std::string issuer = certificate().name;
  try {
    for (const nlohmann::json& json :
         nlohmann::json::parse(core::read_file(folder_ / "issued.json"))) {
      entries.push_back(entry_from(json, issuer));
    }
  } catch (const nlohmann::json::exception& error) {
    throw core::Error(core::Code::kDataLoss,
                      (folder_ / "issued.json").string() + " is damaged: " + error.what());
  }
  return entries;
}

void Authority::save(const std::vector<Entry>& entries) const {
  nlohmann::json json = nlohmann::json::array();
  for (const Entry& entry : entries) {
    json.push_back(to_json(entry));
  }
  write_private_file(folder_ / "issued.json", json.dump(1) + "\n");
}

void Authority::write_list(const std::vector<Entry>& entries, core::Clock::Time now) const {
  Revocations revoked;
  for (const Entry& entry : entries) {
    if (entry.is_revoked) {
      revoked.emplace(entry.certificate.serial, entry.revoked_at);
    }
  }
  core::write_file_atomically(folder_ / "revoked.pem", write_revocations(key_pair(), revoked, now));
}

}  // namespace weft::security
