#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>

#include "security/tls_folder.h"
#include "security/x509.h"

namespace weft::security {

// Whose certificates are good now: not expired, and not on the list of those that the authority
// revoked, which is read again when it changes. That the authority signed them is not asked: the
// handshake did. Any thread.
class Admission {
 public:
  // Throws what reading the folder's list of revoked certificates throws.
  explicit Admission(TlsFolder folder);

  struct Verdict {
    std::optional<Certificate> certificate;  // when it can be read
    std::string problem;                     // why it does not count; empty: it does
  };
  [[nodiscard]] Verdict judge(const std::string& pem);
  // Why the certificate does not count (any more); empty: it does.
  [[nodiscard]] std::string problem_of(const Certificate& certificate);

  // Reads the list if it is another than the last one. One that cannot be read, or is gone, leaves
  // the last one in force.
  void refresh();

 private:
  // What changes when a file is written anew.
  struct FileState {
    std::filesystem::file_time_type time{};
    std::uintmax_t size = 0;
    bool is_there = false;

    friend bool operator==(const FileState&, const FileState&) = default;
  };

  [[nodiscard]] static FileState state_of(const std::filesystem::path& path);
  // REQUIRES of these: mutex_ is held.
  void load_list();
  [[nodiscard]] std::string problem_now(const Certificate& certificate) const;

  const TlsFolder folder_;
  std::mutex mutex_;                                           // guards all below
  std::unordered_map<std::string, Certificate> certificates_;  // by their PEM
  Revocations revoked_;
  FileState list_state_;
};

}  // namespace weft::security
