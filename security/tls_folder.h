#pragma once

#include <filesystem>

#include "core/clock.h"
#include "security/x509.h"

namespace weft::security {

// A folder as `weft certs issue` writes it: who this program is, and whom it trusts.
struct TlsFolder {
  std::filesystem::path path;

  [[nodiscard]] std::filesystem::path certificate() const { return path / "cert.pem"; }
  [[nodiscard]] std::filesystem::path key() const { return path / "key.pem"; }
  // The certificate of the authority that signed all certificates of the cluster.
  [[nodiscard]] std::filesystem::path authority() const { return path / "ca.pem"; }
  // The authority's list of certificates that it revoked; a server reads it, and need not have it.
  [[nodiscard]] std::filesystem::path revoked() const { return path / "revoked.pem"; }
};

enum class TlsUse { kCall, kListen };

// Reads the folder's certificate and finds out whether it can be used now: the files are there, the
// key is its own and nobody else may read it, the authority signed it, its time has come and is not
// over, and a server's names hosts. Throws core::Error that says what is wrong and how to mend it:
// kNotFound (no such file), kPermissionDenied (the certificate cannot be used), kInvalidArgument (a
// file is not what its name says).
[[nodiscard]] Certificate check_tls_folder(const TlsFolder& folder, TlsUse use,
                                           core::Clock::Time now);

// "2026-11-22"
[[nodiscard]] std::string date_text(core::Clock::Time time);

}  // namespace weft::security
