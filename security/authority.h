#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/clock.h"
#include "security/x509.h"

namespace weft::security {

// A private authority: a folder with its key, its certificate, what it issued and what it revoked.
// Whoever reads the key can make certificates of every role: it belongs on a machine that nobody
// else uses, and is needed for these commands only. One process at a time changes it.
//
//   ca.pem        its certificate, which every issued folder has too
//   ca.key        its key, for its owner's eyes only
//   issued.json   what was issued, where to, and what was revoked when
//   revoked.pem   the signed list that servers read
class Authority {
 public:
  // What was issued, in the order of issue.
  struct Entry {
    Certificate certificate;
    std::filesystem::path folder;  // where it was written to
    bool is_revoked = false;
    core::Clock::Time revoked_at;
  };

  // Makes one. Throws core::Error: kAlreadyExists when the folder has one, kUnavailable when the
  // folder cannot be written.
  static Authority make(const std::filesystem::path& folder, const std::string& name,
                        std::chrono::days life, core::Clock::Time now);

  // Throws core::Error(kNotFound) when the folder has none.
  explicit Authority(std::filesystem::path folder);

  // Issues a certificate and writes it to a TlsFolder `out`, whose former certificate it replaces.
  // A request without roles and hosts repeats what the name was given last; `life` ends with the
  // authority at the latest. Throws core::Error(kInvalidArgument) when the name is none, when a
  // role or a host is missing or wrong, or when `out` holds the certificate of another name.
  Entry issue(const std::string& name, std::vector<v1::Role> roles, std::vector<std::string> hosts,
              std::chrono::days life, const std::filesystem::path& out, core::Clock::Time now);

  // Revokes all certificates of the name that are good, or the one with this serial, and writes the
  // list: here and to all folders of servers that this authority wrote and that are still there.
  // Returns those files. Throws core::Error(kNotFound) when there is no such certificate.
  std::vector<std::filesystem::path> revoke(const std::string& name_or_serial,
                                            core::Clock::Time now);

  [[nodiscard]] std::vector<Entry> issued() const;
  [[nodiscard]] Certificate certificate() const;
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  [[nodiscard]] KeyPair key_pair() const;
  void save(const std::vector<Entry>& entries) const;
  void write_list(const std::vector<Entry>& entries, core::Clock::Time now) const;

  std::filesystem::path folder_;
};

}  // namespace weft::security
