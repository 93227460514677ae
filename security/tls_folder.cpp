#include "security/tls_folder.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"
#include "core/file.h"

namespace weft::security {

namespace {

constexpr std::uint64_t kFileLimitBytes = 1 << 20;

std::string read(const std::filesystem::path& path) {
  try {
    return core::read_file(path, kFileLimitBytes);
  } catch (const core::Error& error) {
    throw core::Error(
        core::Code::kNotFound,
        fmt::format("cannot read {}; a folder for --tls-folder has cert.pem, key.pem "
                    "and ca.pem and is written by 'weft certs issue NAME --role ROLE'",
                    path.string()));
  }
}

// A key of root's that we read as one of its group was given to us, as containers are given
// secrets.
void check_privacy(const std::filesystem::path& key) {
  struct stat about {};
  if (stat(key.c_str(), &about) != 0) {
    return;  // reading it says why
  }
  const bool is_given = about.st_uid == 0 && ::geteuid() != 0;
  const mode_t too_much = is_given ? S_IWGRP | S_IXGRP | S_IRWXO : S_IRWXG | S_IRWXO;
  if ((about.st_mode & too_much) != 0) {
    throw core::Error(core::Code::kPermissionDenied,
                      fmt::format("others may read the key {}; say 'chmod 600 {}', and issue the "
                                  "certificate anew if they have",
                                  key.string(), key.string()));
  }
}

[[noreturn]] void refuse(const std::string& what) {
  throw core::Error(core::Code::kPermissionDenied, what);
}

// What OpenSSL says of a text gets the path of its file in front.
template <class Read>
auto named(const std::filesystem::path& path, Read read_text) {
  try {
    return read_text();
  } catch (const core::Error& error) {
    throw core::Error(error.code(), path.string() + ": " + error.what());
  }
}

}  // namespace

std::string date_text(core::Clock::Time time) {
  return fmt::format("{:%Y-%m-%d}", std::chrono::floor<std::chrono::seconds>(time));
}

Certificate check_tls_folder(const TlsFolder& folder, TlsUse use, core::Clock::Time now) {
  const std::string pem = read(folder.certificate());
  const std::string authority = read(folder.authority());
  const std::string key = read(folder.key());
  check_privacy(folder.key());
  const Certificate certificate =
      named(folder.certificate(), [&] { return read_certificate(pem); });
  const Certificate issuer = named(folder.authority(), [&] { return read_certificate(authority); });
  if (!named(folder.key(), [&] { return belong_together({pem, key}); })) {
    refuse(
        fmt::format("{} is not the key of {}; issue the certificate anew with 'weft certs issue "
                    "{}'",
                    folder.key().string(), folder.certificate().string(), certificate.name));
  }
  const std::string whose =
      fmt::format("the certificate of '{}' in {}", certificate.name, folder.path.string());
  if (!is_signed_by(pem, authority)) {
    refuse(
        fmt::format("{} is signed by another authority ('{}') than the one in ca.pem ('{}'); copy "
                    "the folder as 'weft certs issue' wrote it",
                    whose, certificate.issuer, issuer.name));
  }
  if (now > certificate.valid_until) {
    refuse(fmt::format("{} expired on {}; issue it anew with 'weft certs issue {}'", whose,
                       date_text(certificate.valid_until), certificate.name));
  }
  if (now < certificate.valid_from) {
    refuse(fmt::format("{} is valid from {} on only; is this machine's clock right?", whose,
                       date_text(certificate.valid_from)));
  }
  if (now > issuer.valid_until) {
    refuse(
        fmt::format("the authority '{}' in {} expired on {}; make a new one with 'weft certs "
                    "init' and issue all certificates anew",
                    issuer.name, folder.path.string(), date_text(issuer.valid_until)));
  }
  if (use == TlsUse::kListen && certificate.hosts.empty()) {
    refuse(
        fmt::format("{} is for callers only; a server's is issued with 'weft certs issue {} "
                    "--host NAME', with the names and addresses by which others call it",
                    whose, certificate.name));
  }
  return certificate;
}

}  // namespace weft::security
